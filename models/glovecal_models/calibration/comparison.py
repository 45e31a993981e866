"""A calibration model held against takes with reference: how far is it off, where, and does it know?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.takes.take import Take

WITHIN_ONE_SD = 0.6827
"""Share of errors a truthful standard deviation covers (normal distribution)."""


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
    """Share of measurements within one claimed standard deviation; 0.68 is truthful."""
    baseline_deg: float
    """Standard deviation of the measured angle: the error of always answering its mean."""


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

    over_all: RotationErrors
    rotations: dict[str, RotationErrors]
    poses: tuple[PoseErrors, ...]
    not_measured: tuple[str, ...]
    """Rotations of the model that no take measured."""
    not_predicted: tuple[str, ...]
    """Rotations the takes measured that the model does not predict."""

    def to_document(self) -> dict[str, Any]:
        """Plain JSON-able data."""
        return asdict(self)


def compare(model: CalibrationModel, takes: Sequence[Take]) -> Comparison:
    """Hold ``model`` against ``takes``. Raises LayoutMismatch, and BadInput when nothing was measured."""
    return summed_up(residuals(model, takes))


def summed_up(found: Residuals) -> Comparison:
    """Residuals as numbers: over all, for each rotation, for each pose."""
    error, spread, reference = (found.stacked(name) for name in ("error", "sd", "measured"))
    measured = found.measured_rotations
    columns = {name: [found.column(name)] for name in measured}
    in_takes = {name for item in found.takes for name in item.take.rotations}
    return Comparison(
        over_all=_errors(error, spread, reference),
        rotations={
            name: _errors(error[:, column], spread[:, column], reference[:, column])
            for name, column in columns.items()
        },
        poses=_pose_errors(error, np.concatenate([_poses(item.take) for item in found.takes])),
        not_measured=tuple(name for name in found.rotations if name not in measured),
        not_predicted=tuple(sorted(in_takes - set(found.rotations))),
    )


def _poses(take: Take) -> np.ndarray:
    return np.array(take.poses if take.poses is not None else [""] * len(take.time_s), dtype=object)


def _errors(error: np.ndarray, spread: np.ndarray, reference: np.ndarray) -> RotationErrors:
    usable = np.isfinite(error)
    values = error[usable]
    counts = np.maximum(usable.sum(axis=0), 1)
    centred = reference - np.where(usable, reference, 0.0).sum(axis=0) / counts
    return RotationErrors(
        count=len(values),
        rmse_deg=float(np.sqrt(np.mean(values**2))),
        mae_deg=float(np.mean(np.abs(values))),
        bias_deg=float(np.mean(values)),
        percentile_95_deg=float(np.percentile(np.abs(values), 95)),
        coverage=float(np.mean(np.abs(values) <= spread[usable])),
        baseline_deg=float(np.sqrt(np.mean(centred[usable] ** 2))),
    )


def _pose_errors(error: np.ndarray, poses: np.ndarray) -> tuple[PoseErrors, ...]:
    names = [name for name in dict.fromkeys(poses.tolist()) if name]
    found = []
    for name in names:
        values = np.abs(error[poses == name])
        values = values[np.isfinite(values)]
        if len(values):
            found.append(PoseErrors(name, len(values), float(values.mean()), float(values.std())))
    return tuple(found)
