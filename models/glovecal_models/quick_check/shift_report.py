"""What a quick check found, in numbers and sentences, and how far that is from a full calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.sensor_sensitivity import SensorSensitivity
from glovecal_models.quick_check.checked_poses import CheckedPose
from glovecal_models.quick_check.wearing_shift import WearingShift, sensor_shift

UNINFORMED = 0.8
"""Share of the prior's variance above which the poses said next to nothing."""
MOST_NAMED = 6


@dataclass(frozen=True)
class RotationShift:
    """One rotation's shift in the new wearing, added to its prediction. Degrees."""

    rotation: str
    offset_deg: float
    offset_sd_deg: float
    gain_deg_per_sd: float
    """Per standard deviation of the joint."""
    gain_sd_deg_per_sd: float
    prior_sd_deg: float
    """Of the offset, before the check."""
    expected_now_deg: float
    """RMSE to expect of the wearing before the check."""
    expected_after_deg: float
    full_calibration_deg: float
    """The model's held-out error in the wearings it was trained on."""
    is_informed: bool
    """False: no pose said anything, the prior stays."""


@dataclass(frozen=True)
class SensorShift:
    """By how much a sensor reads more than in training."""

    sensor: str
    readings: float
    sd_readings: float
    prior_sd_readings: float
    degrees: float | None
    """On the scale of the rotation it measures; None: no rotation moves with it."""
    sd_degrees: float | None
    is_informed: bool


@dataclass(frozen=True)
class ShiftReport:
    rotations: tuple[RotationShift, ...]
    sensors: tuple[SensorShift, ...]
    poses_before_deg: float
    """RMS error of the poses used, with the model as it was."""
    poses_left_out_deg: float | None
    """RMS error of each pose with the shift that the others tell; None with a single pose."""
    sentences: tuple[str, ...]

    @property
    def expected(self) -> dict[str, float]:
        """RMSE over all rotations, degrees: now, after the check, with a full calibration."""
        return {
            name: _rms([getattr(item, f"{field}_deg") for item in self.rotations])
            for name, field in (
                ("now_deg", "expected_now"),
                ("after_deg", "expected_after"),
                ("full_calibration_deg", "full_calibration"),
            )
        }

    @property
    def uninformed(self) -> tuple[str, ...]:
        return tuple(item.rotation for item in self.rotations if not item.is_informed)

    def to_document(self) -> dict[str, Any]:
        return {
            "expected": self.expected,
            "poses_before_deg": self.poses_before_deg,
            "poses_left_out_deg": self.poses_left_out_deg,
            "rotations": [asdict(item) for item in self.rotations],
            "sensors": [asdict(item) for item in self.sensors],
            "uninformed": list(self.uninformed),
            "sentences": list(self.sentences),
        }


def shift_report(
    model: CalibrationModel,
    sensitivity: SensorSensitivity,
    prior: WearingShift,
    shift: WearingShift,
    poses: Sequence[CheckedPose],
) -> ShiftReport:
    """``shift`` is what ``poses`` made of ``prior``."""
    rotations = _rotations(model, sensitivity, prior, shift)
    before = _rms([item.before_deg for item in poses])
    left = [item.left_out_deg for item in poses if item.left_out_deg is not None]
    sensors = _sensors(sensitivity, prior, shift)
    report = ShiftReport(rotations, sensors, before, _rms(left) if left else None, ())
    return replace(report, sentences=tuple(_sentences(report, len(poses))))


def _rotations(
    model: CalibrationModel, sensitivity: SensorSensitivity, prior: WearingShift, shift: WearingShift
) -> tuple[RotationShift, ...]:
    by_name = {item.rotation: item for item in model.rotations}
    sd, prior_sd = np.sqrt(np.diag(shift.covariance)), np.sqrt(np.diag(prior.covariance))
    lanes = prior.lanes
    found = []
    for lane, name in enumerate(sensitivity.rotations):
        item = by_name[name]
        full = item.held_out_rmse_deg or float(np.sqrt(item.regressor.noise_variance))
        now, after = prior.usual_variance[lane], shift.usual_variance[lane]
        found.append(
            RotationShift(
                rotation=name,
                offset_deg=float(shift.mean[lane]),
                offset_sd_deg=float(sd[lane]),
                gain_deg_per_sd=float(shift.mean[lanes + lane]),
                gain_sd_deg_per_sd=float(sd[lanes + lane]),
                prior_sd_deg=float(prior_sd[lane]),
                expected_now_deg=float(np.sqrt(full**2 + now)),
                expected_after_deg=float(np.sqrt(full**2 + after)),
                full_calibration_deg=float(full),
                is_informed=bool(after < UNINFORMED * now),
            )
        )
    return tuple(found)


def _sensors(
    sensitivity: SensorSensitivity, prior: WearingShift, shift: WearingShift
) -> tuple[SensorShift, ...]:
    mean, sd = sensor_shift(sensitivity, prior, shift)
    _, prior_sd = sensor_shift(sensitivity, prior, prior)
    found = []
    for column, name in enumerate(sensitivity.sensors):
        rotation = sensitivity.measuring(name)
        if rotation is None:
            continue
        slope = float(sensitivity.slope[sensitivity.rotations.index(rotation), column])
        found.append(
            SensorShift(
                sensor=name,
                readings=float(mean[column]),
                sd_readings=float(sd[column]),
                prior_sd_readings=float(prior_sd[column]),
                degrees=float(slope * mean[column]),
                sd_degrees=float(abs(slope) * sd[column]),
                is_informed=bool(sd[column] ** 2 < UNINFORMED * prior_sd[column] ** 2),
            )
        )
    return tuple(found)


def _sentences(report: ShiftReport, poses: int) -> list[str]:
    expected = report.expected
    told = [
        f"{poses} {'pose' if poses == 1 else 'poses'}: the error to expect in this wearing falls from "
        f"{expected['now_deg']:.1f} to {expected['after_deg']:.1f} degrees; a full calibration has "
        f"{expected['full_calibration_deg']:.1f}."
    ]
    if report.poses_left_out_deg is not None:
        told.append(
            f"Each pose predicted with what the others tell is off by {report.poses_left_out_deg:.1f} "
            f"degrees; without the check by {report.poses_before_deg:.1f}."
        )
        if report.poses_left_out_deg > report.poses_before_deg:
            told.append("They do not foretell each other: take one or two more, spread over the range.")
    if report.uninformed:
        names = ", ".join(report.uninformed[:MOST_NAMED])
        more = len(report.uninformed) - MOST_NAMED
        names += f" and {more} more" if more > 0 else ""
        told.append(f"No pose tells anything of {names}: they stay as uncertain as a new wearing is.")
    return told


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
