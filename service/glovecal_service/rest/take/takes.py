"""``takes``: recordings with or without reference angles."""

from __future__ import annotations

import tempfile
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, Response
from fastapi.responses import FileResponse
from pydantic import BaseModel, Field
from starlette.background import BackgroundTask

from glovecal_models.hand.handedness import Handedness
from glovecal_models.takes.take import Take as TakeArrays
from glovecal_models.takes.take_check import check_take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.plain import plain
from glovecal_service.rest.http.answers import change_problems, problems
from glovecal_service.rest.http.damaged_rows import without_damaged
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.problem import Problem
from glovecal_service.rest.http.request_types import (
    HandFilter,
    Identifier,
    IdInPath,
    LayoutFilter,
    StrictBody,
    SubjectFilter,
)
from glovecal_service.rest.take.uploads import MEDIA_TYPES, TableFormat
from glovecal_service.store.records import TakeRecord, incomplete_sentences
from glovecal_service.store.takes import UNWRAPPED

router = APIRouter(prefix="/takes", tags=["takes"])


class Take(BaseModel):
    id: str
    name: str
    subject: str
    layout: str
    wearing: str
    source: str
    artifact: str = Field(description="sha256 of the stored arrays.")
    original_sha256: str | None = Field(description="sha256 of the uploaded file, which is kept.")
    sensors: list[str]
    rotations: list[str] = Field(description="Rotations with a reference.")
    context: list[str]
    frames: int
    reference_rows: int
    teaches: bool = Field(description="Whether a calibration can learn from it.")
    known_hand: Handedness | None = Field(description="Which hand its glove is for; null: nobody said it.")
    hand_shape: str | None = Field(
        description="The session's shape that is held; methods template and two_shapes learn from it."
    )
    duration_s: float
    simulated: bool
    recording: str | None
    state: Literal["complete", "repairing"] = Field(
        description="`repairing`: frames of its recording may still be fetched from the capture log."
    )
    accounting: dict[str, Any] | None
    facts: dict[str, Any]
    created_at: datetime | None


class SensorRangeView(BaseModel):
    sensor: str
    low: float
    high: float
    changed: float = Field(description="Share of frames whose reading differs from the one before.")


class RotationRangeView(BaseModel):
    rotation: str
    rows: int = Field(description="Reference rows that have it.")
    low_deg: float
    high_deg: float


class ReferenceJumpView(BaseModel):
    rotation: str
    start_s: float = Field(description="On the reference's clock, as `time_s` of the take.")
    end_s: float
    rows: int
    size_deg: float
    comes_back: bool = Field(description="Its angles are left out of training and of errors.")


class CheckView(BaseModel):
    take: Take
    rate_hz: float | None = Field(description="By the median interval between frames.")
    gaps: int = Field(description="Intervals in which frames are missing.")
    longest_interval_s: float | None
    repeated_frames: float = Field(description="Share of frames that are the same as the one before.")
    frames_with_reference: float = Field(
        description="Share of frames with at least one reference angle; the pre-roll is not counted."
    )
    pre_roll_frames: int = Field(description="Frames before the take was asked for.")
    pre_roll_s: float
    sensors: list[SensorRangeView]
    rotations: list[RotationRangeView]
    jumps: list[ReferenceJumpView] = Field(description="Where the reference jumps while the sensors do not.")
    sentences: list[str] = Field(description="What looks wrong.")


@router.get("", response_model=list[Take], summary="Takes, oldest first", responses=problems())
def list_takes(
    store: StoreNeeded,
    response: Response,
    subject: SubjectFilter = None,
    layout: LayoutFilter = None,
    hand: HandFilter = None,
) -> list[TakeRecord]:
    """Damaged rows are left out and named in `Warning` headers."""
    every = without_damaged(response, lambda: store.takes.list(subject=subject, layout=layout))
    return [take for take in every if take.is_of(hand)]


@router.get("/{id}", response_model=Take, summary="One take", responses=problems())
def get_take(id: IdInPath, store: StoreNeeded) -> TakeRecord:
    return store.takes.get(id)


@router.get(
    "/{id}/check",
    response_model=CheckView,
    summary="How regular a take is, what was measured, what looks wrong",
    responses=problems(),
)
def check_one_take(id: IdInPath, store: StoreNeeded) -> dict[str, Any]:
    record = store.takes.get(id)
    found = plain(asdict(check_take(store.takes.load(id))))
    return {
        "take": record,
        **found,
        "sentences": [*incomplete_sentences([record]), *record.facts.get(UNWRAPPED, ()), *found["sentences"]],
    }


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
    folder = tempfile.TemporaryDirectory(prefix="glovecal-export-")
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
