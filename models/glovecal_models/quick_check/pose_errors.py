"""What a model gets wrong in each held pose, as one witness per pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.sensor_sensitivity import SensorSensitivity
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.joint_units import in_joint_units
from glovecal_models.quick_check.held_poses import HeldPose
from glovecal_models.quick_check.pose_book import PoseBook
from glovecal_models.quick_check.wearing_shift import PoseError
from glovecal_models.takes.take import Take

REFERENCE_SD_DEG = 0.5
"""Of a measured angle's mean over a hold: what a reference is off by beside its noise."""


@dataclass(frozen=True, eq=False)
class ObservedPose:
    """One held pose with what is known of its angles; arrays are (L,) over the trained rotations, degrees."""

    pose: HeldPose
    witness: PoseError
    predicted: np.ndarray
    """Without a shift."""
    angle: np.ndarray
    """NaN where nothing is known."""
    measured: np.ndarray
    """True where the angle was measured, not told by the pose's name."""
    saturated: tuple[str, ...]
    """Sensors at the end of what the hardware can send; their rotations are left out."""


def pose_errors(
    model: CalibrationModel,
    units: Settings,
    poses: Sequence[HeldPose],
    sensitivity: SensorSensitivity,
    known: PoseBook,
) -> list[ObservedPose]:
    """For each of ``poses``; ``units`` are the joints' own units (``own_centre_deg``, ``own_scale_deg``)."""
    predictor = GlovePredictor(model)
    predictions = {id(pose.take): _Predicted(predictor, pose.take, sensitivity) for pose in poses}
    found = []
    for pose in poses:
        take = predictions[id(pose.take)]
        angle, sd, measured = _known_angles(pose, sensitivity.rotations, known)
        saturated = _saturated(pose, model)
        blind = (sensitivity.slope[:, [name in saturated for name in sensitivity.sensors]] != 0).any(axis=1)
        angle = np.where(blind, np.nan, angle)
        predicted = take.mean[pose.frames].mean(axis=0)
        joint = in_joint_units(take.base[pose.frames].mean(axis=0)[None], units)[0]
        # Not divided by the frames: what the regressor is off by here it is off by in all of them.
        variance = (take.sd[pose.frames] ** 2).mean(axis=0) + sd**2
        witness = PoseError(angle - predicted, joint, variance)
        found.append(ObservedPose(pose, witness, predicted, angle, measured, saturated))
    return found


class _Predicted:
    """A take's frames (N, L) as the model predicts them without a shift, degrees."""

    def __init__(self, predictor: GlovePredictor, take: Take, sensitivity: SensorSensitivity) -> None:
        rows = [predictor.rotations.index(name) for name in sensitivity.rotations]
        readings = take.readings[:, [take.sensors.index(name) for name in predictor.sensors]]
        angles = predictor.predict(readings)
        self.base, self.sd = angles.mean[:, rows].copy(), angles.sd[:, rows]
        corrected = predictor.predict_take(take.time_s, readings, take.context, take.wearing)
        self.mean = corrected.mean[:, rows]


def _known_angles(
    pose: HeldPose, rotations: Sequence[str], known: PoseBook
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle, standard deviation and whether it was measured, (L,) each."""
    reference = pose.take.reference_at_frames(rotations)[pose.frames]
    finite = np.isfinite(reference)
    measured = finite.mean(axis=0) >= 0.5
    sums = np.where(finite, reference, 0.0).sum(axis=0)
    angle = np.where(measured, sums / np.maximum(finite.sum(axis=0), 1), np.nan)
    sd = np.full(len(rotations), REFERENCE_SD_DEG)
    if pose.name in known:
        book = known[pose.name]
        for lane, rotation in enumerate(rotations):
            if not measured[lane] and rotation in book.angles:
                angle[lane], sd[lane] = book.angles[rotation], book.sd[rotation]
    return angle, sd, measured


def _saturated(pose: HeldPose, model: CalibrationModel) -> tuple[str, ...]:
    """Sensors that stand at an end of the hardware's range for most of the pose."""
    if model.layout.counts is None:
        return ()
    low, high = model.layout.counts
    readings = pose.take.readings[pose.frames]
    at_end = ((readings <= low) | (readings >= high)).mean(axis=0) > 0.5
    return tuple(name for name, stuck in zip(pose.take.sensors, at_end, strict=True) if stuck)
