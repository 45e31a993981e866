"""A quick check as an answer shows it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.quick_check.checked_poses import CheckedPose
from glovecal_models.quick_check.quick_check import QuickCheck
from glovecal_models.quick_check.text import quick_check_sentences
from glovecal_service.plain import plain


class CheckedPoseView(BaseModel):
    pose: str
    seconds: float
    measured: int = Field(description="Rotations whose angle was measured.")
    by_name: int = Field(description="Rotations whose angle is known by the pose's name.")
    saturated: list[str] = Field(
        description="Sensors at the end of their range: their rotations are excluded."
    )
    before_deg: float = Field(description="RMS error with the model as it was.")
    held_out_deg: float | None = Field(description="RMS error with the shift learned from the other poses.")


class RefusedPoseView(BaseModel):
    pose: str
    reason: str


class ExpectedErrorView(BaseModel):
    now_deg: float = Field(description="RMSE to expect of the wearing before the check.")
    after_deg: float
    full_calibration_deg: float = Field(description="The model's held-out error in its training wearings.")


class RotationShiftView(BaseModel):
    rotation: str
    offset_deg: float = Field(description="Added to the prediction in this wearing.")
    offset_sd_deg: float
    gain_deg_per_sd: float = Field(description="Added per standard deviation of the joint.")
    gain_sd_deg_per_sd: float
    prior_sd_deg: float = Field(description="Of the offset, before the check.")
    expected_now_deg: float
    expected_after_deg: float
    full_calibration_deg: float
    is_informed: bool = Field(description="False: no pose informs it, the prior stays.")


class SensorShiftView(BaseModel):
    sensor: str
    readings: float = Field(description="By how much it reads more than in training, raw readings.")
    sd_readings: float
    prior_sd_readings: float
    degrees: float | None = Field(description="On the scale of the rotation it measures.")
    sd_degrees: float | None
    is_informed: bool


class QuickCheckView(BaseModel):
    model: str = Field(description="The child, which knows the wearing.")
    parent: str
    active: bool
    wearing: str
    poses: list[CheckedPoseView]
    refused: list[RefusedPoseView] = Field(description="Poses that were not used, and why.")
    expected: ExpectedErrorView
    as_found_deg: float = Field(description="RMS error of the poses with the old model, in this wearing.")
    as_left_deg: float | None = Field(
        description="After the check, each pose predicted from the others; null with one pose."
    )
    is_full_calibration_due: bool
    pose_noise_deg: float = Field(description="What model and hand are off by in one pose, RMS.")
    poses_before_deg: float
    poses_held_out_deg: float | None = Field(
        description="RMS error of each pose with the shift learned from the others; null with one pose."
    )
    rotations: list[RotationShiftView]
    sensors: list[SensorShiftView]
    uninformed: list[str] = Field(description="Rotations that no pose informs.")
    sentences: list[str]


def quick_check_view(found: QuickCheck, model: str, parent: str, *, active: bool) -> QuickCheckView:
    """``model`` is the id of the child."""
    report = found.report
    facts = {
        "model": model,
        "parent": parent,
        "active": active,
        "wearing": found.wearing,
        "poses": [_pose(item) for item in found.poses],
        "refused": [{"pose": item.label, "reason": item.reason} for item in found.refused],
        **asdict(report),
        **found_and_left(found),
        "expected": report.expected,
        "uninformed": report.uninformed,
        "sentences": quick_check_sentences(found),
    }
    return QuickCheckView.model_validate(plain(facts))


def found_and_left(found: QuickCheck) -> dict[str, Any]:
    """The error before and after the check, as it is kept with the model."""
    return {
        "as_found_deg": found.report.poses_before_deg,
        "as_left_deg": found.report.poses_held_out_deg,
        "is_full_calibration_due": found.report.is_full_calibration_due,
    }


def _pose(item: CheckedPose) -> dict[str, Any]:
    names = ("seconds", "measured", "by_name", "saturated", "before_deg", "held_out_deg")
    return {"pose": item.label, **{name: getattr(item, name) for name in names}}
