"""How many times its noise floor a held-out error is, with the bounds that its stretches of time give.

An error that is short, rare and on one joint alone has no slow part and nothing in common with others; that
it is far above what the measurements repeat themselves to is all that shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits

STRETCH_S = 10.0


@dataclass(frozen=True)
class FloorRatio:
    """The held-out error of one joint, readings and reference identically smoothed, beside its floor."""

    rmse_deg: float
    lower_bound_deg: float
    """Lower end of the one-sided 95 % interval, from stretches of 10 s."""
    floor: NoiseFloor
    """Of errors that are not smoothed: a smoothed one may lie below it."""
    stretches: int
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    @property
    def is_judgeable(self) -> bool:
        """Whether floor and error are known well enough."""
        known = self.floor.is_reliable and not self.floor.is_lower_bound and self.floor.floor_deg > 0
        return known and self.stretches >= self.limits.slow_fewest_stretches

    @property
    def times(self) -> float:
        return self.rmse_deg / max(self.floor.floor_deg, 1e-9)

    @property
    def lower_times(self) -> float:
        """The lower bound of the error over the upper end of the floor's interval."""
        return self.lower_bound_deg / max(self.floor.high_deg, 1e-9)

    @property
    def is_within_floor(self) -> bool:
        """Whether the error is noise: inside the interval of a floor that is known well enough."""
        return self.is_judgeable and self.rmse_deg <= self.floor.high_deg

    @property
    def is_healthy(self) -> bool:
        """Whether the error is so few floors as a healthy glove's; False where that cannot be judged."""
        return self.is_judgeable and self.times <= self.limits.healthy_floors

    @property
    def exceeds(self) -> float:
        """Times the most that a healthy glove has; 0 where that cannot be judged."""
        return self.lower_times / self.limits.healthy_floors if self.is_judgeable else 0.0


def floor_ratios(design: ForwardDesign, floors: Mapping[str, NoiseFloor]) -> dict[str, FloorRatio]:
    """Of each joint of ``design`` whose floor is known."""
    found = {}
    for joint, name in enumerate(design.rotations):
        squares, counts = _stretches(design, joint)
        if name in floors and counts.sum():
            rmse = float(np.sqrt(squares.sum() / counts.sum()))
            lower = _lower_deg(squares, counts, design.limits)
            found[name] = FloorRatio(rmse, lower, floors[name], len(counts), design.limits)
    return found


def _stretches(design: ForwardDesign, joint: int) -> tuple[np.ndarray, np.ndarray]:
    """Sum of squared errors and number of rows in each stretch, (K,) both."""
    squares, counts = [], []
    for (take, rows), residual in zip(design.units(joint), design.products[joint].residual, strict=True):
        if not len(rows):
            continue
        time = design.signals[take].time_s[rows]
        number = ((time - time[0]) / STRETCH_S).astype(int)
        squares.append(np.bincount(number, residual**2))
        counts.append(np.bincount(number))
    if not counts:
        return np.zeros(0), np.zeros(0)
    square, count = np.concatenate(squares), np.concatenate(counts)
    return square[count > 0], count[count > 0]


def _lower_deg(squares: np.ndarray, counts: np.ndarray, limits: DiagnosisLimits) -> float:
    """Of a ratio of sums over stretches (Cochran 1977), by Student's t; 0 from one stretch."""
    number = len(counts)
    if number < 2:
        return 0.0
    mean = squares.sum() / counts.sum()
    differing = squares - mean * counts
    error = np.sqrt(number / (number - 1) * np.sum(differing**2)) / counts.sum()
    return float(np.sqrt(max(mean - stdtrit(number - 1, limits.slow_confidence) * error, 0.0)))
