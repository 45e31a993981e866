"""How fast a context column changes: the slope of a line through its recent past, frame by frame.

Older frames count less, within ``MEMORY_S``. Until a line is known to better than chance it is taken as flat,
so that a column's noise and steps of its last digit do not pass for a change.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.effects.base.history_effect import elapsed_s, unbroken
from glovecal_models.effects.base.relaxation import relax, relax_once

MEMORY_S = 40.0
FLAT_S = 2.0
"""A past that reaches back so far is believed by half."""
_TAU = np.full(5, MEMORY_S)


class SlopeState:
    """Sums over the past, relative to its first frame. Unknown values (NaN) count for nothing."""

    def __init__(self) -> None:
        self._sums = np.zeros(5)
        self._origin = np.nan
        self._passed_s = 0.0

    def step(self, elapsed_s: float, value: float) -> float:
        """Slope per second after the next frame's value."""
        self._passed_s += elapsed_s
        relax_once(
            self._sums, elapsed_s, self._moments(np.array([self._passed_s]), np.array([value]))[0], _TAU
        )
        return float(_slope(self._sums))

    def run(self, elapsed_s: np.ndarray, value: np.ndarray) -> np.ndarray:
        """Slopes (B,) after each of B frames: the same as so many steps."""
        passed = self._passed_s + np.cumsum(elapsed_s)
        sums = relax(self._sums, elapsed_s, self._moments(passed, value), _TAU)
        self._passed_s = float(passed[-1])
        return _slope(sums)

    def _moments(self, passed: np.ndarray, value: np.ndarray) -> np.ndarray:
        known = np.isfinite(value)
        if not np.isfinite(self._origin) and known.any():
            self._origin = float(value[known.argmax()])
        height = np.where(known, value - self._origin, 0.0) if known.any() else np.zeros(len(value))
        one = known.astype(float)
        return np.column_stack([one, one * passed, one * passed**2, height, height * passed])


def _slope(sums: np.ndarray) -> np.ndarray:
    """(...,) of sums (..., 5)."""
    one, time, square, height, product = np.moveaxis(sums, -1, 0)
    spread = one * square - time**2 + (one * FLAT_S) ** 2
    return np.where(spread > 0, (one * product - time * height) / np.maximum(spread, 1e-300), 0.0)


def slopes(time_s: np.ndarray, value: np.ndarray) -> np.ndarray:
    """(N,) per second; a gap in the frames begins anew."""
    elapsed = elapsed_s(time_s)
    result = np.zeros(len(time_s))
    for part in unbroken(time_s):
        if part.stop > part.start:
            result[part] = SlopeState().run(elapsed[part], value[part])
    return result
