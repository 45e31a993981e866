"""A context column that the sensor follows late: besides the column's value its slope matters.

A sensor that takes minutes T to take up what surrounds it feels h - T dh/dt, to first order; inside a take
the second part is often the larger one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.context_effect import PRIOR_DEG, ContextEffect
from glovecal_models.effects.base.context_slope import MEMORY_S, SlopeState, slopes
from glovecal_models.effects.base.effect import Stream
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.history_effect import LONGEST_GAP_S
from glovecal_models.effects.base.signals import Signals

STEEPEST_SHARE = 99.0
"""Percentile of the slopes in training; steeper ones are held there."""


class SlowContextEffect(ContextEffect):
    """Columns of the context column and its square, and one more: its slope over the last half minute."""

    has_memory: ClassVar[bool] = True

    def settling_s(self, shape: np.ndarray) -> float:
        return MEMORY_S if len(shape) else 0.0

    def settle(self, takes: Sequence[Signals]) -> Settings:
        settings = super().settle(takes)
        found = [
            slopes(take.time_s, take.context[self.column]) for take in takes if self.column in take.context
        ]
        steepest = float(np.percentile(np.abs(np.concatenate(found)), STEEPEST_SHARE))
        return settings | {"steepest_per_s": max(steepest, 1e-9)}

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

    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        return _SlowContextStream(self, settings, shape)

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.append(super().prior_sd(settings), PRIOR_DEG)

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        steepest = 60.0 * settings["steepest_per_s"]
        return (*super().weight_names(settings), f"offset_deg_per_{steepest:.3g}[c.{self.column}]_per_min")


class _SlowContextStream(Stream):
    def __init__(self, effect: SlowContextEffect, settings: Settings, shape: np.ndarray) -> None:
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
