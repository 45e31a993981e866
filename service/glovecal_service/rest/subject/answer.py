"""Subjects and their hands as REST gives them."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import Field

from glovecal_models.hand.rotations import Handedness
from glovecal_service.plain import Row


class Subject(Row):
    name: str
    title: str
    dimensions: dict[str, float] = Field(description="Measured hand dimensions in millimetres.")
    hand: str = Field(description="right, left, or unknown: for what does not say its hand itself.")
    created_at: datetime


class HistoryRowView(Row):
    made_at: datetime
    model: str
    layout: str
    hand: Handedness | None = Field(description="Whose glove; null: its takes do not say.")
    kind: Literal["calibration", "quick check"]
    wearing: str | None = Field(description="Of a quick check.")
    as_found_deg: float | None = Field(
        description="Of a quick check: RMS error of its poses with the model before, in that wearing."
    )
    as_left_deg: float | None = Field(description="After the check, each pose predicted from the others.")
    rmse_unseen_wearing_deg: float | None = Field(description="Of the calibration, in a wearing not seen.")
    held_out_rmse_deg: float | None = Field(description="Of the calibration, in wearings seen.")


class HistoryView(Row):
    subject: str
    rows: list[HistoryRowView] = Field(description="Oldest first.")
    is_full_calibration_due: bool = Field(
        description="By the last quick check after the last calibration, of either hand."
    )
    sentences: list[str]


class BackupView(Row):
    file: str
    written_at: datetime


class Erasure(Row):
    id: str = Field(description="Stands for the subject in the log of changes, as `erased-ID`.")
    is_finished: bool = Field(
        description="False where files could not be removed yet: tried again once an hour and at each start."
    )
    removed: dict[str, int] = Field(description="Rows by table, and `files`.")
    rewritten_entries: int = Field(
        description="Of the log of changes: they no longer say who it was, and it is still what was written."
    )
    backups: list[BackupView] = Field(description="In the data folder; they still hold the subject.")
    capture_logs: list[str] = Field(
        description="Gloves whose capture computers may still keep frames, in the folder `capture` there."
    )
    sentences: list[str] = Field(description="What was done, and what else is left, for a person.")


class SkeletonRotationView(Row):
    name: str
    low: float = Field(description="Limits, degrees.")
    high: float
    rule: dict[str, float] | None = Field(
        description="What stands in when it is not measured: a weighted sum of other rotations,"
    )
    rest: float | None = Field(description="or else an angle.")


class JointView(Row):
    name: str
    parent: str | None = Field(description="Null for the forearm.")
    offset: list[float] = Field(description="In the parent's frame, mm.")
    orientation: list[float] = Field(description="Quaternion w, x, y, z, in the parent's frame.")
    axis: list[float]
    rotations: dict[str, float] = Field(description="The joint's angle: the sum of weight times rotation.")


class TipView(Row):
    finger: str
    joint: str
    offset: list[float] = Field(description="In the joint's frame, mm.")


class HandSizes(Row):
    sizes: dict[str, float] = Field(description="Every dimension, mm.")
    measured: list[str] = Field(description="Those that were measured; the others follow from hand_length.")


class SkeletonView(Row):
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
