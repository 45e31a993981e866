"""``subjects``: the people whose hands are calibrated."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from glovecal_models.hand.dimensions import DIMENSIONS
from glovecal_models.hand.handedness import Handedness
from glovecal_models.hand.skeleton import Palm
from glovecal_models.hand.skeleton_document import skeleton_document
from glovecal_service.rest.http.answers import change_problems, problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import (
    Channel,
    LayoutFilter,
    Millimetres,
    StrictBody,
    SubjectInPath,
    SubjectName,
    Title,
)
from glovecal_service.store.records import SubjectRecord
from glovecal_service.views.history import HistoryView, history_view

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


class Subject(BaseModel):
    name: str
    title: str
    dimensions: dict[str, float] = Field(description="Measured hand dimensions in millimetres.")
    hand: str = Field(description="right, left, or unknown: for what does not say its hand itself.")
    created_at: datetime


class SkeletonRotationView(BaseModel):
    name: str
    low: float = Field(description="Limits, degrees.")
    high: float
    rule: dict[str, float] | None = Field(
        description="What stands in when it is not measured: a weighted sum of other rotations,"
    )
    rest: float | None = Field(description="or else an angle.")


class JointView(BaseModel):
    name: str
    parent: str | None = Field(description="Null for the forearm.")
    offset: list[float] = Field(description="In the parent's frame, mm.")
    orientation: list[float] = Field(description="Quaternion w, x, y, z, in the parent's frame.")
    axis: list[float]
    rotations: dict[str, float] = Field(description="The joint's angle: the sum of weight times rotation.")


class TipView(BaseModel):
    finger: str
    joint: str
    offset: list[float] = Field(description="In the joint's frame, mm.")


class HandSizes(BaseModel):
    sizes: dict[str, float] = Field(description="Every dimension, mm.")
    measured: list[str] = Field(description="Those that were measured; the others follow from hand_length.")


class SkeletonView(BaseModel):
    format: str = Field(description="glovecal.skeleton.v1")
    hand: str
    length_unit: str
    angle_unit: str
    dimensions: HandSizes
    rotations: list[SkeletonRotationView]
    joints: list[JointView] = Field(
        description="Parents before children: frame(joint) = frame(parent) . translate(offset) . "
        "orient(orientation) . turn(axis, angle). x along the middle metacarpal to the fingers, z out of the "
        "back of the hand, y to the thumb of a right hand; right-handed."
    )
    tips: list[TipView]


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


@router.get("", response_model=list[Subject], summary="All subjects", responses=problems())
def list_subjects(store: StoreNeeded) -> list[SubjectRecord]:
    return store.subjects.list()


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
