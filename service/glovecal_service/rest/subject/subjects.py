"""``subjects``: the people whose hands are calibrated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Response
from fastapi.responses import StreamingResponse
from pydantic import Field

from glovecal_models.hand.dimensions import DIMENSIONS
from glovecal_models.hand.rotations import Handedness, is_of_hand
from glovecal_models.hand.skeleton import Palm, skeleton_document
from glovecal_models.quick_check.answer import DUE
from glovecal_service.exports.robot_hand import RobotForm, robot_hand
from glovecal_service.plain import plain
from glovecal_service.request_types import Channel, Millimetres, StrictBody, SubjectName, Title
from glovecal_service.rest.http.dependencies import PartsNeeded, StoreNeeded
from glovecal_service.rest.http.list_part import Searched
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import LayoutFilter, SubjectInPath
from glovecal_service.rest.subject.answer import HistoryRowView, HistoryView, SkeletonView, Subject
from glovecal_service.store.records import ModelRecord, SubjectRecord
from glovecal_service.store.subject_archive import SubjectArchive

XML, ZIP = "application/xml", "application/zip"


def history_view(subject: str, records: Sequence[ModelRecord]) -> HistoryView:
    """``records``: the subject's models, oldest first."""
    rows = [_row(record) for record in records]
    hands: set[Handedness | None] = {record.hand for record in records if record.hand} or {None}
    newest = [next((each for each in records[::-1] if is_of_hand(each.hand, hand)), None) for hand in hands]
    is_due = any(
        each.facts.get("quick_check", {}).get("is_full_calibration_due")
        for each in newest
        if each is not None
    )
    checks = [row for row in rows if row.as_found_deg is not None]
    sentences = []
    if checks:
        found = ", ".join(f"{row.as_found_deg:.1f}" for row in checks)
        sentences.append(f"As found, in the order of the quick checks: {found} degrees.")
    if is_due:
        sentences.append(DUE)
    return HistoryView(subject=subject, rows=rows, is_full_calibration_due=is_due, sentences=sentences)


def _row(record: ModelRecord) -> HistoryRowView:
    check, facts = record.facts.get("quick_check"), plain(record.facts)
    of_check = {name: (facts.get("quick_check") or {}).get(name) for name in OF_CHECK}
    return HistoryRowView(
        made_at=record.created_at,
        model=record.id,
        layout=record.layout,
        hand=record.hand,
        kind="calibration" if check is None else "quick check",
        **of_check,
        **{name: facts.get(name) if check is None else None for name in OF_CALIBRATION},
    )


OF_CHECK = ("wearing", "as_found_deg", "as_left_deg")
OF_CALIBRATION = ("rmse_unseen_wearing_deg", "held_out_rmse_deg")


router = APIRouter(prefix="/subjects", tags=["subjects"])


Dimensions = Annotated[
    dict[Channel, Millimetres],
    Field(
        max_length=len(DIMENSIONS),
        description=f"What was measured of the hand, mm: {', '.join(DIMENSIONS)}. hand_length comes with any "
        "other; what is missing follows from it.",
    ),
]


class NewSubject(StrictBody):
    name: SubjectName
    title: Title = ""
    dimensions: Dimensions = Field(default_factory=dict)
    hand: Handedness | None = Field(None, description="Null: not known; asked for where it matters.")


class MeasuredHand(StrictBody):
    dimensions: Dimensions
    hand: Handedness | None = Field(None, description="Null: as it was.")


@router.post(
    "",
    status_code=201,
    response_model=Subject,
    summary="Add a subject",
    responses=change_problems(409),
)
def add_subject(body: NewSubject, store: StoreNeeded, response: Response) -> SubjectRecord:
    """409 when the name is taken."""
    record = store.subjects.create(body.name, title=body.title, dimensions=body.dimensions, hand=body.hand)
    response.headers["Location"] = f"/v1/subjects/{record.name}"
    return record


@router.get("", response_model=list[Subject], summary="Subjects, by name", responses=problems())
def list_subjects(store: StoreNeeded, paging: Searched) -> list[SubjectRecord]:
    """More than `limit`: see `Link`."""
    return paging.answer(store.subjects.page(paging.part))


@router.get("/{name}", response_model=Subject, summary="One subject", responses=problems())
def get_subject(name: SubjectInPath, store: StoreNeeded) -> SubjectRecord:
    return store.subjects.get(name)


@router.get(
    "/{name}/history",
    response_model=HistoryView,
    summary="Calibrations and quick checks in order of time",
    responses=problems(),
)
def get_history(name: SubjectInPath, store: StoreNeeded, layout: LayoutFilter = None) -> HistoryView:
    """Errors of each quick check as found and as left, and whether a full calibration is due."""
    subject = store.subjects.get(name)
    return history_view(subject.name, store.models.list(subject=subject.name, layout=layout))


@router.put(
    "/{name}/hand",
    response_model=Subject,
    summary="Say how large a subject's hand is",
    responses=change_problems(),
)
def measure_hand(name: SubjectInPath, body: MeasuredHand, store: StoreNeeded) -> SubjectRecord:
    """Replaces all that was measured before. Models stay as they are; errors in mm follow."""
    return store.subjects.measure(name, body.dimensions, body.hand)


@router.get(
    "/{name}/skeleton",
    response_model=SkeletonView,
    summary="The subject's hand, for viewers",
    responses=problems(),
)
def get_skeleton(
    name: SubjectInPath, store: StoreNeeded, hand: Handedness | None = None, palm: Palm = "rigid"
) -> dict[str, Any]:
    """Joints, axes, offsets and limits; of the other hand with `hand`. With `palm=arching` the little
    finger's metacarpal is a joint, turned by the rotation PALM_ARCH."""
    return skeleton_document(store.subjects.get(name).skeleton(hand, palm))


@router.get(
    "/{name}/robot",
    response_class=Response,
    summary="The subject's hand, for robotics",
    responses=problems()
    | {200: {"description": "XML.", "content": {XML: {"schema": {"type": "string", "format": "binary"}}}}},
)
def get_robot(
    name: SubjectInPath,
    store: StoreNeeded,
    form: RobotForm = "urdf",
    hand: Handedness | None = None,
    palm: Palm = "rigid",
) -> Response:
    """As URDF (ROS) or MJCF (MuJoCo): joints have the names of the rotations; radians and metres."""
    text = robot_hand(store.subjects.get(name).skeleton(hand, palm), form)
    return Response(text, media_type=XML)


@router.get(
    "/{name}/export",
    response_class=StreamingResponse,
    summary="All that is kept of a subject, for the subject",
    responses=problems()
    | {
        200: {
            "description": "A zip file whose README.txt says what each file is; manifest.json, its last, has "
            "the sha256 of each.",
            "content": {ZIP: {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
def export_subject(name: SubjectInPath, parts: PartsNeeded) -> StreamingResponse:
    """Takes, recordings as they came, videos, models, wearings, samplings, jobs, and changes that concern
    the subject. It is made while it is sent; one that breaks off has no manifest and is no zip file."""
    archive = SubjectArchive(parts.store, name)
    headers = {"Content-Disposition": f'attachment; filename="{name}.zip"', "Cache-Control": "no-store"}
    return StreamingResponse(archive.parts(), media_type=ZIP, headers=headers)


@router.delete(
    "/{name}",
    status_code=204,
    response_class=Response,
    summary="Remove a subject",
    responses=change_problems(409),
)
def remove_subject(name: SubjectInPath, store: StoreNeeded) -> None:
    """409 while the subject owns takes or models."""
    store.subjects.remove(name)
