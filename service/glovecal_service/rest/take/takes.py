"""``takes``: recordings with or without reference angles."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Response
from fastapi.responses import FileResponse
from pydantic import Field, FiniteFloat
from starlette.background import BackgroundTask

from glovecal_models.takes.take import Take as TakeArrays
from glovecal_models.takes.take_check import check_take
from glovecal_models.takes.time_code import FrameRate, TimeCode
from glovecal_models.takes.write_table import write_takes
from glovecal_service.plain import plain, plain_text
from glovecal_service.request_types import ONE_LINE, Identifier, StrictBody
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.list_part import ByTime
from glovecal_service.rest.http.problem import Problem, change_problems, problems
from glovecal_service.rest.http.request_types import HandFilter, IdInPath, LayoutFilter, SubjectFilter
from glovecal_service.rest.http.temporary_folder import temporary_folder
from glovecal_service.rest.take.answer import CheckView, Take
from glovecal_service.rest.take.uploads import MEDIA_TYPES, TableFormat
from glovecal_service.store.records import TakeRecord, incomplete_sentences
from glovecal_service.store.takes import UNWRAPPED

router = APIRouter(prefix="/takes", tags=["takes"])


@router.get("", response_model=list[Take], summary="Takes, oldest first", responses=problems())
def list_takes(
    store: StoreNeeded,
    paging: ByTime,
    subject: SubjectFilter = None,
    layout: LayoutFilter = None,
    hand: HandFilter = None,
) -> list[TakeRecord]:
    """Damaged rows are left out and named in `Warning` headers. More than `limit`: see `Link`."""
    return paging.answer(store.takes.page(paging.part, subject=subject, layout=layout, hand=hand))


@router.get("/{id}", response_model=Take, summary="One take", responses=problems())
def get_take(id: IdInPath, store: StoreNeeded) -> TakeRecord:
    return store.takes.get(id)


@router.get(
    "/{id}/check",
    response_model=CheckView,
    summary="How regular a take is, what was measured, what looks wrong",
    responses=problems(),
)
def check_one_take(id: IdInPath, store: StoreNeeded) -> CheckView:
    record, take = store.takes.get(id), store.takes.load(id)
    found = plain(asdict(check_take(take)))
    ends = () if record.time_code is None else (take.time_s[take.pre_roll_frames], take.time_s[-1])
    found["time_codes"] = [record.time_code.at(float(time_s)) for time_s in ends if record.time_code]
    known = [*incomplete_sentences([record]), *record.facts.get(UNWRAPPED, ())]
    found["sentences"] = [*known, *found["sentences"]]
    return CheckView(take=Take.model_validate(record, from_attributes=True), **found)


class TakeLayout(StrictBody):
    layout: Identifier


@router.put(
    "/{id}/layout",
    response_model=Take,
    summary="Read a take's rotations by another layout",
    responses=change_problems(),
)
def put_layout(id: IdInPath, body: TakeLayout, store: StoreNeeded) -> TakeRecord:
    """Frames and reference stay as they are; models that were trained on the take stay what they are. 422
    when the take lacks a sensor of the layout."""
    return store.takes.use_layout(id, store.layouts.get(body.layout))


class TakeTimeCode(StrictBody):
    time_code: Annotated[str, Field(max_length=40, pattern=ONE_LINE)] = Field(
        description="HH:MM:SS:FF of a frame; `;` before the frames is drop-frame."
    )
    rate: FrameRate | None = Field(None, description="Frames a second; null: 29.97 drop-frame.")
    at_s: FiniteFloat = Field(description="When that frame begins, seconds since the take's first frame.")
    source: Annotated[str, Field(max_length=200, pattern=ONE_LINE)] = "entered"


@router.put(
    "/{id}/time-code",
    response_model=Take,
    summary="Say which SMPTE time code a take has",
    responses=change_problems(),
)
def put_time_code(id: IdInPath, body: TakeTimeCode, store: StoreNeeded) -> TakeRecord:
    """Kept by the take's clock, beside its frames."""
    time_s = float(store.takes.load_recorded(id).time_s[0]) + body.at_s
    return store.takes.note_time_code(
        id, TimeCode.of_text(body.time_code, body.rate, time_s, plain_text(body.source))
    )


@router.delete(
    "/{id}/time-code", response_model=Take, summary="Forget a take's time code", responses=change_problems()
)
def remove_time_code(id: IdInPath, store: StoreNeeded) -> TakeRecord:
    return store.takes.note_time_code(id, None)


class TakeNote(StrictBody):
    note: Annotated[str, Field(max_length=2000)]


@router.put(
    "/{id}/note", response_model=Take, summary="Note something of a take", responses=change_problems()
)
def put_note(id: IdInPath, body: TakeNote, store: StoreNeeded) -> TakeRecord:
    """What people want to remember of it; lists find its words. Empty: nothing."""
    return store.takes.describe(id, note=plain_text(body.note))


class LeftOut(StrictBody):
    from_s: FiniteFloat = Field(description="Seconds since its first frame.")
    to_s: FiniteFloat


@router.post(
    "/{id}/left-out",
    response_model=Take,
    summary="Leave a stretch of a take out",
    responses=change_problems(),
)
def leave_out(id: IdInPath, body: LeftOut, store: StoreNeeded) -> TakeRecord:
    """Of training, comparison and diagnosis from now on, as if no frame had come there. What is stored of the
    take stays, and so do models that were trained on it."""
    return store.takes.leave_out(id, (body.from_s, body.to_s))


class UsedAgain(StrictBody):
    stretch: LeftOut | None = Field(None, description="null: the one that was left out last.")


@router.post(
    "/{id}/left-out/undo",
    response_model=Take,
    summary="Use a stretch of a take again",
    responses=change_problems(),
)
def use_again(id: IdInPath, body: UsedAgain, store: StoreNeeded) -> TakeRecord:
    again = None if body.stretch is None else (body.stretch.from_s, body.stretch.to_s)
    return store.takes.use_again(id, again)


@router.delete(
    "/{id}",
    status_code=204,
    response_class=Response,
    summary="Remove a take",
    responses=change_problems(409),
)
def remove_take(id: IdInPath, store: StoreNeeded) -> None:
    """409 when a model was trained on it. The uploaded file stays."""
    store.takes.remove(id)


@router.get(
    "/{id}/export",
    response_class=FileResponse,
    summary="A take as a table",
    responses=problems(409)
    | {
        200: {
            "description": "A take table.",
            "content": {
                kind: {"schema": {"type": "string", "format": "binary"}} for kind in MEDIA_TYPES.values()
            },
        }
    },
)
def export_take(
    id: IdInPath,
    store: StoreNeeded,
    format: TableFormat = "csv",
    part: Literal["all", "frames", "reference"] = "all",
) -> FileResponse:
    """A take whose reference has a clock of its own is two tables: ask for each `part` (409 for `all`)."""
    take = store.takes.load_recorded(id)
    folder = temporary_folder()
    try:
        path = _chosen_part(write_takes([take], Path(folder.name) / f"{id}.{format}"), part, take)
    except BaseException:
        folder.cleanup()
        raise
    return FileResponse(
        path, media_type=MEDIA_TYPES[format], filename=path.name, background=BackgroundTask(folder.cleanup)
    )


def _chosen_part(written: list[Path], part: str, take: TakeArrays) -> Path:
    if len(written) == 1:
        if part == "reference":
            raise Problem(409, "conflict", f"take {take.name!r} is one table; ask for part=all")
        return written[0]
    if part == "all":
        raise Problem(
            409,
            "conflict",
            "this take's reference has a clock of its own: ask for part=frames and part=reference",
        )
    return written[0] if part == "frames" else written[1]
