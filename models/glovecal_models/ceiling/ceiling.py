"""What a black box on everything recorded makes of a model's error: a verdict with an interval.

When something is left to gain from what was recorded, and when nothing is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.special import stdtrit

from glovecal_models.limit import limit

Verdict = Literal["gain", "none", "undecided"]
RECIPE = 3
"""Rises when the same model and takes get another answer: results kept of an earlier one are not used."""
EXACT_FLIPS = 14
RANDOM_FLIPS = 20000


@dataclass(frozen=True)
class CeilingLimits:
    """Of the verdict on the black-box ceiling."""

    none_below: float = limit(
        0.05,
        "share of the RMSE",
        "With the upper bound of the gain below this, nothing is left to gain.",
        "Chosen: a fall that a user would not notice.",
    )
    gain_p_value: float = limit(
        0.01,
        "p value",
        "Of the gain, by flipping the sign of whole takes; of a rotation, divided by their number.",
        "Chosen.",
    )
    least_gain: float = limit(
        0.02,
        "share of the RMSE",
        "A smaller gain is not told, however significant.",
        "Chosen.",
    )
    most_by_take: float = limit(
        0.5,
        "share of a rotation's squared error",
        "With more of it changing from take to take, it is not said that nothing is left to gain.",
        "At most 0.35 in 8 simulated clean gloves, 0.66 to 0.84 in 15 with a cause that changes from take to"
        " take at 1.3 noise floors (2026-11-22).",
    )
    fewest_takes: int = limit(
        6,
        "takes",
        "With fewer there is no verdict.",
        "Flipping the signs of five takes cannot give p below 0.03.",
    )


CEILING_LIMITS = CeilingLimits()


@dataclass(frozen=True)
class Gain:
    """The error of one rotation, or of all, and what the box takes off it beyond its controls."""

    rmse_deg: float
    """Of the model on left-out quarters of its takes, not smoothed."""
    ceiling_deg: float
    """With the box, or of the model where the box is no better."""
    lowest_deg: float
    """With the upper 95 % bound of what the box gains."""
    offline_deg: float
    """Of the model on the same quarters with both directions of time: the limit of recordings."""
    share: float
    """Of the RMSE, that the box takes off."""
    low_share: float
    high_share: float
    """The 95 % interval of it, by whole takes."""
    p_value: float
    """One-sided, by flipping the sign of whole takes."""

    @classmethod
    def of(cls, saved: np.ndarray, mean_square: float, offline_square: float, seed: int) -> Gain:
        """``saved`` (takes,): of each take, degrees squared; their mean is what is saved of the square."""
        count, mean = len(saved), float(saved.mean())
        error = float(saved.std(ddof=1)) / np.sqrt(count) * float(stdtrit(count - 1, 0.975))
        best = np.sqrt(max(mean_square - max(mean, 0.0), 0.0))
        low, mid, high = (_share(value / mean_square) for value in (mean - error, mean, mean + error))
        rmse = float(np.sqrt(mean_square))
        lowest = rmse * (1 - max(high, 0.0))
        offline = float(np.sqrt(offline_square))
        return cls(rmse, float(best), lowest, offline, mid, low, high, sign_flip_p_value(saved, seed))


@dataclass(frozen=True)
class Ceiling:
    """The black-box ceiling of a model on some takes."""

    verdict: Verdict
    overall: Gain | None
    """None where the takes cannot tell anything."""
    rotations: Mapping[str, Gain] = field(default_factory=dict)
    groups: Mapping[str, float] = field(default_factory=dict)
    """For each group of columns how much the box's RMSE rises when they are exchanged between takes, degrees;
    the largest first, and only where there is a gain."""
    unrecorded: tuple[str, ...] = ()
    """Context columns that some effect reads and that no take has."""
    takes: int = 0
    obstacle: str | None = None
    """Why these takes cannot tell."""
    limits: CeilingLimits = CEILING_LIMITS

    @property
    def gaining(self) -> tuple[str, ...]:
        """Rotations that gain significantly, the one with the largest gain first."""
        found = [name for name, gain in self.rotations.items() if is_gain(gain, self.limits, self._tested)]
        return tuple(
            sorted(found, key=lambda name: self.rotations[name].ceiling_deg - self.rotations[name].rmse_deg)
        )

    @property
    def _tested(self) -> int:
        return max(len(self.rotations), 1)


def is_gain(gain: Gain, limits: CeilingLimits, tested: int = 1) -> bool:
    """Significant among ``tested`` rotations, and large enough to be told."""
    return gain.p_value <= limits.gain_p_value / tested and gain.share >= limits.least_gain


def verdict_of(overall: Gain, rotations: Mapping[str, Gain], limits: CeilingLimits) -> Verdict:
    """Overall, or of single rotations: one that gains is enough, none may."""
    one = any(
        is_gain(gain, limits, len(rotations)) and gain.high_share >= limits.none_below
        for gain in rotations.values()
    )
    if one or (is_gain(overall, limits) and overall.high_share >= limits.none_below):
        return "gain"
    return "none" if overall.high_share < limits.none_below else "undecided"


def sign_flip_p_value(saved: np.ndarray, seed: int) -> float:
    """Share of sign flips of whole takes whose sum is at least that of ``saved`` (takes,)."""
    count = len(saved)
    if count <= EXACT_FLIPS:
        signs = 1.0 - 2.0 * ((np.arange(2**count)[:, None] >> np.arange(count)) & 1)
        return float(np.mean(signs @ saved >= saved.sum() - 1e-12))
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (RANDOM_FLIPS, count))
    return float((1 + np.count_nonzero(signs @ saved >= saved.sum())) / (RANDOM_FLIPS + 1))


def _share(of_square: float) -> float:
    """Of the RMSE, from a share of its square; a loss is negative."""
    return float(1 - np.sqrt(max(1 - of_square, 0.0)))
