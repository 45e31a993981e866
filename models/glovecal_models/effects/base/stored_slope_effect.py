"""How models were stored before: the slope of the context column is that of a line through the recent past.

Older frames count less, within ``MEMORY_S``; until a line is known to better than chance it is taken as flat.
Only models that were stored so read it; new ones have ``SlowContextEffect``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.context_effect import PRIOR_DEG, ContextEffect
from glovecal_models.effects.base.effect import Stream
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.history_effect import LONGEST_GAP_S, elapsed_s, unbroken
from glovecal_models.effects.base.relaxation import relax, relax_once
from glovecal_models.effects.base.signals import Signals

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


class StoredSlopeEffect(ContextEffect):
    """Columns of the context column and its square, and one more: its slope over the last half minute."""

    has_memory: ClassVar[bool] = True

    def transient_s(self, shape: np.ndarray, settings: Settings) -> float:
        return MEMORY_S if len(shape) else 0.0

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        value = take.context.get(self.column)
        slope = np.zeros(len(take)) if value is None else slopes(take.time_s, value)
        return self.with_slope(take, slope, settings, shape)

    def with_slope(
        self, take: Signals, slope: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        """Columns (N, L, C) with the column's slope (N,), per second, given."""
        steepness = np.clip(slope / settings["steepest_per_s"], -1.0, 1.0)
        each = np.repeat(steepness[:, None, None], len(shape), axis=1)
        return np.concatenate([super().columns(take, settings, shape), each], axis=2)

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> Mapping[str, np.ndarray]:
        """The column and how steeply it changes: together they tell how far the sensor is behind."""
        return {**super().form_inputs(take, columns, settings), f"slope of {self.column}": columns[:, :, -1]}

    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        return _StoredSlopeStream(self, settings, shape)

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.append(super().prior_sd(settings), PRIOR_DEG)

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        steepest = 60.0 * settings["steepest_per_s"]
        return (*super().weight_names(settings), f"offset_deg_per_{steepest:.3g}[c.{self.column}]_per_min")


class _StoredSlopeStream(Stream):
    def __init__(self, effect: StoredSlopeEffect, settings: Settings, shape: np.ndarray) -> None:
        self._effect, self._settings, self._shape = effect, settings, shape
        self._state: SlopeState | None = None
        self._last_s = 0.0

    def columns(self, frame: Signals) -> np.ndarray:
        time = float(frame.time_s[0])
        elapsed = time - self._last_s
        # A clock that was set back tells as little of what happened as a gap does.
        if self._state is None or not 0.0 <= elapsed <= LONGEST_GAP_S:
            self._state, elapsed = SlopeState(), 0.0
        self._last_s = time
        value = frame.context.get(self._effect.column, np.full(1, np.nan))
        slope = np.array([self._state.step(elapsed, float(value[0]))])
        return self._effect.with_slope(frame, slope, self._settings, self._shape)

    def reset(self) -> None:
        self._state = None
