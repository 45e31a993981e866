"""The error of one model on the way, and whether it is at the noise floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.calibration.held_out_check import HeldOutErrors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.at_floor import is_at_floor as is_one_at_floor
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import residuals
from glovecal_models.takes.take import Take


def step_errors(
    model: CalibrationModel, holdout: Sequence[Take], left_out: HeldOutErrors
) -> tuple[dict[str, float], float]:
    """RMSE, degrees, of each rotation and over all: on ``holdout`` when there is one, else ``left_out``."""
    if not holdout:
        return {name: left_out.rmse_deg(name) for name in left_out.square}, left_out.over_all_deg
    found = residuals(model, holdout)
    error = found.stacked("error")
    each = {
        name: float(np.sqrt(np.nanmean(error[:, found.column(name)] ** 2)))
        for name in found.measured_rotations
    }
    return each, float(np.sqrt(np.nanmean(error**2)))


def is_at_floor(
    rmse_deg: Mapping[str, float],
    floors: Mapping[str, NoiseFloor],
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> bool:
    """Whether every rotation whose floor is known is at it; False when none is."""
    pairs = [(rmse_deg[name], floor) for name, floor in floors.items() if name in rmse_deg]
    return bool(pairs) and all(is_one_at_floor(error, floor, limits) for error, floor in pairs)
