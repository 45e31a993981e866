"""How uncertain a slip makes a prediction: so much at the start of a run, more with every minute since.

Nothing tells where the glove sits when a run starts, so the takes' different offsets are there from its first
frame. From there the offset walks, and its variance grows in proportion to the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.optimize import minimize

from glovecal_models.effects.effect import Settings
from glovecal_models.effects.interval_effect import Interval, LeftOutErrors

GROWS_S = 1800.0
"""A cloth does not walk away for ever: from then on the variance stays."""
LEAST_SHARE, MOST_SHARE = 0.05, 20.0
LEAST_RATE, MOST_RATE = 1e-3, 20.0
"""Degrees in a minute; the least is no growth."""
FITTED_HZ = 10.0


@dataclass(frozen=True)
class SlipGrowth:
    """Of one rotation."""

    start_share: float
    """Variance at the start over the noise variance of training; below 1 where that took slip for noise."""
    rate_deg_per_sqrt_min: float

    def to_settings(self) -> Settings:
        """Plain JSON-able data."""
        return asdict(self)


class SlipInterval(Interval):
    """Of L rotations."""

    def __init__(self, growths: Sequence[SlipGrowth], noise: np.ndarray) -> None:
        self._at_start = (np.array([item.start_share for item in growths]) - 1.0) * noise
        self._a_minute = np.array([item.rate_deg_per_sqrt_min**2 for item in growths])

    def added_variance(self, since_start_s: np.ndarray, readings: np.ndarray) -> np.ndarray:
        minutes = np.clip(since_start_s, 0.0, GROWS_S) / 60.0
        return self._at_start + minutes[:, None] * self._a_minute


def slip_growth(left_out: Sequence[LeftOutErrors]) -> SlipGrowth:
    """The growth under which the errors of one rotation are most probable (normal distribution)."""
    parts = [_thinned(item) for item in left_out]
    square, known, noise, time = (np.concatenate(column) for column in zip(*parts, strict=True))

    def misfit(logarithms: np.ndarray) -> float:
        share, rate = np.exp(logarithms)
        claimed = known + share * noise + rate**2 * np.clip(time, 0.0, GROWS_S) / 60.0
        return float(np.mean(np.log(claimed) + square / claimed))

    bounds = [np.log([LEAST_SHARE, MOST_SHARE]), np.log([LEAST_RATE, MOST_RATE])]
    starts = [np.log([1.0, 0.1]), np.log([0.3, 1.0])]
    found = [minimize(misfit, start, method="L-BFGS-B", bounds=bounds) for start in starts]
    share, rate = np.exp(min(found, key=lambda item: float(item.fun)).x)
    return SlipGrowth(float(share), float(rate))


def _thinned(item: LeftOutErrors) -> tuple[np.ndarray, ...]:
    """Squared error, variance without noise, noise and time, some ten frames a second of them."""
    lasts = float(np.ptp(item.since_start_s)) if len(item.error) else 0.0
    step = max(1, round(len(item.error) / max(lasts * FITTED_HZ, 1.0)))
    square, variance = item.error[::step] ** 2, item.variance[::step]
    known = np.maximum(variance - item.noise, 1e-9)
    return square, known, np.full(len(square), item.noise), item.since_start_s[::step]
