"""Errors of a calibration model on takes with reference, and whether its standard deviations are right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.fingertips import FingertipErrors, fingertip_errors
from glovecal_models.comparison.floor_estimate import NoiseFloor, joined
from glovecal_models.comparison.noise_floor import RotationNoise, rotation_noise
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.takes.camera_reference.covered_range import CoveredRange, covered_ranges
from glovecal_models.takes.take import Take

WITHIN_ONE_SD = 0.6827
"""Share of errors that a correct standard deviation covers (normal distribution)."""


@dataclass(frozen=True)
class RotationErrors:
    """Errors (predicted minus measured) of one rotation, or of all together, in degrees."""

    count: int
    rmse_deg: float
    mae_deg: float
    bias_deg: float
    percentile_95_deg: float
    """95 % of the absolute errors are at or below this."""
    coverage: float
    """Share of measurements within one claimed standard deviation; 0.68 is expected."""
    nlpd: float | None
    """Mean negative log predictive density, nats: the mean of ln(sd sqrt(2 pi)) + 1/2 (error / sd)^2.

    Smaller is better. A constant standard deviation that is as large as the RMSE has ln(RMSE) + 1.42; always
    answering the mean angle has ln(baseline) + 1.42. None where a claimed standard deviation is 0 or missing.
    """
    baseline_deg: float
    """Standard deviation of the measured angle: the error of always answering its mean."""
    floor: NoiseFloor | None
    """How small the RMSE can get on these measurements."""


@dataclass(frozen=True)
class PoseErrors:
    """Mean and standard deviation of the absolute error over all rotations in one pose (paper, Table 3)."""

    pose: str
    count: int
    mean_deg: float
    sd_deg: float


@dataclass(frozen=True)
class Comparison:
    """Model against measurements."""

    overall: RotationErrors
    rotations: dict[str, RotationErrors]
    poses: tuple[PoseErrors, ...]
    not_measured: tuple[str, ...]
    """Rotations of the model that no take measured."""
    not_predicted: tuple[str, ...]
    """Rotations the takes measured that the model does not predict."""
    fingertips: FingertipErrors | None
    """None where no finger's chain was predicted and measured."""
    unseen_wearing: RotationErrors | None = None
    """Overall, on takes of wearings not seen in training; None: there are none, or the model does not say."""
    seen_wearing: RotationErrors | None = None
    """Overall, on takes of the wearings it knows."""
    unseen_wearings: tuple[str, ...] = ()
    seen_wearings: tuple[str, ...] = ()
    excluded: dict[str, int] = field(default_factory=dict)
    """Measured frames, by rotation, that are not compared: faulty sensors, repeated frames."""
    camera_ranges: tuple[CoveredRange, ...] = ()
    """Of the rotations whose reference states deviations: angles outside were not compared."""


def compare(
    model: CalibrationModel, takes: Sequence[Take], *, dimensions: HandDimensions | None = None
) -> Comparison:
    """Errors of ``model`` on ``takes``. Raises LayoutMismatch, and BadInput when nothing was measured.

    ``dimensions`` of the subject's hand, for the errors of fingertips.
    """
    return summed_up(residuals(model, takes), dimensions=dimensions)


def summed_up(
    found: Residuals,
    noise: Mapping[str, RotationNoise] | None = None,
    *,
    dimensions: HandDimensions | None = None,
) -> Comparison:
    """Residuals as numbers: over all, each rotation, each pose, fingertips. ``noise`` spares its time."""
    noise = rotation_noise(found) if noise is None else noise
    error, spread, reference = (found.stacked(name) for name in ("error", "sd", "measured"))
    measured = found.measured_rotations
    columns = {name: [found.column(name)] for name in measured}
    in_takes = {name for item in found.takes for name in item.take.rotations}
    rotations = {
        name: _errors(error[:, column], spread[:, column], reference[:, column], noise[name].floor)
        for name, column in columns.items()
    }
    return Comparison(
        overall=_errors(error, spread, reference, _floor_of_all(rotations)),
        rotations=rotations,
        poses=_pose_errors(error, np.concatenate([_poses(item.take) for item in found.takes])),
        not_measured=tuple(name for name in found.rotations if name not in measured),
        not_predicted=tuple(sorted(in_takes - set(found.rotations))),
        fingertips=fingertip_errors(found, {name: one.floor for name, one in rotations.items()}, dimensions),
        unseen_wearing=_errors_where(found, is_seen=False),
        seen_wearing=_errors_where(found, is_seen=True),
        unseen_wearings=_wearings_where(found, is_seen=False),
        seen_wearings=_wearings_where(found, is_seen=True),
        excluded=found.excluded,
        camera_ranges=covered_ranges([item.take for item in found.takes], measured),
    )


def _wearings_where(found: Residuals, *, is_seen: bool) -> tuple[str, ...]:
    chosen = [
        item for item in found.takes if item.has_seen_wearing is is_seen and np.isfinite(item.error).any()
    ]
    return tuple(dict.fromkeys(item.take.wearing for item in chosen))


def _errors_where(found: Residuals, *, is_seen: bool) -> RotationErrors | None:
    """Overall, of the takes whose wearing the model knows, or does not know."""
    chosen = tuple(item for item in found.takes if item.has_seen_wearing is is_seen)
    if not any(np.isfinite(item.error).any() for item in chosen):
        return None
    part = Residuals(found.rotations, chosen)
    return _errors(part.stacked("error"), part.stacked("sd"), part.stacked("measured"), None)


def _poses(take: Take) -> np.ndarray:
    return np.array(take.poses if take.poses is not None else [""] * len(take.time_s), dtype=object)


def _floor_of_all(rotations: Mapping[str, RotationErrors]) -> NoiseFloor | None:
    """None when that of some rotation is unknown."""
    known = [(one.floor, one.count) for one in rotations.values() if one.floor is not None]
    return joined(*zip(*known, strict=True)) if known and len(known) == len(rotations) else None


def _errors(
    error: np.ndarray, spread: np.ndarray, reference: np.ndarray, floor: NoiseFloor | None
) -> RotationErrors:
    usable = np.isfinite(error)
    values, claimed = error[usable], spread[usable]
    counts = np.maximum(usable.sum(axis=0), 1)
    centred = reference - np.where(usable, reference, 0.0).sum(axis=0) / counts
    rmse = float(np.sqrt(np.mean(values**2)))
    return RotationErrors(
        count=len(values),
        rmse_deg=rmse,
        mae_deg=float(np.mean(np.abs(values))),
        bias_deg=float(np.mean(values)),
        percentile_95_deg=float(np.percentile(np.abs(values), 95)),
        coverage=float(np.mean(np.abs(values) <= claimed)),
        nlpd=_nlpd(values, claimed),
        baseline_deg=float(np.sqrt(np.mean(centred[usable] ** 2))),
        floor=None if floor is None else floor.beside(rmse),
    )


def _nlpd(values: np.ndarray, claimed: np.ndarray) -> float | None:
    if not (np.isfinite(claimed) & (claimed > 0)).all():
        return None
    return float(np.mean(np.log(claimed * np.sqrt(2 * np.pi)) + 0.5 * (values / claimed) ** 2))


def _pose_errors(error: np.ndarray, poses: np.ndarray) -> tuple[PoseErrors, ...]:
    names = [name for name in dict.fromkeys(poses.tolist()) if name]
    found = []
    for name in names:
        values = np.abs(error[poses == name])
        values = values[np.isfinite(values)]
        if len(values):
            found.append(PoseErrors(name, len(values), float(values.mean()), float(values.std())))
    return tuple(found)
