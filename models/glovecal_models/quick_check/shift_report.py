"""The shift that a quick check found, and the error to expect with it, beside a full calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.sensor_sensitivity import SensorSensitivity
from glovecal_models.quick_check.checked_poses import CheckedPose
from glovecal_models.quick_check.wearing_shift import WearingShift, sensor_shift

UNINFORMED = 0.8
"""Share of the prior's variance above which the poses are uninformative."""
FULL_CALIBRATION_TIMES = 2.0
"""Times what model and hand are off by in a pose: five independent errors of a sound model exceed it by
chance in 1 of 800 checks (chi-squared, 5 degrees of freedom)."""


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
    """False: no pose informs it, the prior stays."""


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
    poses_held_out_deg: float | None
    """RMS error of each pose with the shift learned from the others; None with a single pose."""
    pose_noise_deg: float
    """RMS of what model and hand are off by in one pose, when the wearing is known."""

    @property
    def is_full_calibration_due(self) -> bool:
        """Whether the check leaves more than model and hand explain: it no longer puts the model right."""
        left = self.poses_held_out_deg
        return left is not None and left > FULL_CALIBRATION_TIMES * self.pose_noise_deg

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
    left = [item.held_out_deg for item in poses if item.held_out_deg is not None]
    sensors = _sensors(sensitivity, prior, shift)
    noise = np.concatenate([item.witness.variance[item.witness.known] for item in poses])
    return ShiftReport(rotations, sensors, before, _rms(left) if left else None, float(np.sqrt(noise.mean())))


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


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
