"""Whether an error is at its noise floor: the one rule for every page and sentence."""

from __future__ import annotations

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits


def is_at_floor(
    rmse_deg: float, floor: NoiseFloor | None, limits: ComparisonLimits = COMPARISON_LIMITS
) -> bool:
    """False where no floor is known, or only a lower bound of one."""
    if floor is None or floor.is_lower_bound:
        return False
    return reaches_floor(rmse_deg, floor.high_deg, limits)


def reaches_floor(rmse_deg: float, high_deg: float, limits: ComparisonLimits = COMPARISON_LIMITS) -> bool:
    """``high_deg``: the upper end of the floor's 95 % interval."""
    return rmse_deg <= limits.at_floor_times * high_deg
