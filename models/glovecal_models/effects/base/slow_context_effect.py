"""A context column that the sensor follows late: besides the column's value, how far the sensor is behind it.

A sensor that takes minutes T to take up what surrounds it feels h - T s, where s is the column's mean slope
over the past minutes (``followed_column``); inside a take the second part is often the larger one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.column_steps import step_columns, step_names, step_prior_sd
from glovecal_models.effects.base.context_effect import PRIOR_DEG, ContextEffect
from glovecal_models.effects.base.effect import Stream
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.followed_column import ColumnStart, FollowedColumn, mean_slopes
from glovecal_models.effects.base.history_effect import LONGEST_GAP_S
from glovecal_models.effects.base.signals import Signals

STEEPEST_SHARE = 99.0
"""Percentile of the slopes in training: the unit of the slope's column."""
SLOPE_REACH = 1.5
"""Steeper ones are followed so far, in that unit: the next take is seldom inside all others."""
KNOWN_AFTER_S = 10.0
"""From then on the slope is as good as known: on simulated takes the error it leaves falls no further."""
START = "start"
"""Where settings keep how takes begin."""


class SlowContextEffect(ContextEffect):
    """Columns of the context column and its square, and one more: its mean slope over the past minutes.

    Two more where it acts in steps.
    """

    has_memory: ClassVar[bool] = True
    has_any_form: ClassVar[bool] = True
    may_act_in_steps: ClassVar[bool] = True
    take_sd_deg: ClassVar[float] = 0.5  # what came before the first frame is known by its slope only

    def transient_s(self, shape: np.ndarray, settings: Settings) -> float:
        return KNOWN_AFTER_S if len(shape) else 0.0

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        settings = super().fit_constants(takes)
        known = [(take.time_s, take.context[self.column]) for take in takes if self.column in take.context]
        start = ColumnStart.of_takes(known)
        away = np.abs(np.concatenate([mean_slopes(*take, start) for take in known]) - start.slope)
        steepest = float(np.percentile(away, STEEPEST_SHARE))
        return settings | {START: start.to_settings(), "steepest_per_s": max(steepest, 1e-9)}

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        value, start = take.context.get(self.column), ColumnStart(**settings[START])
        slope = np.full(len(take), start.slope) if value is None else mean_slopes(take.time_s, value, start)
        return self.with_slope(take, slope, settings, shape)

    def with_slope(
        self, take: Signals, slope: np.ndarray, settings: Settings, shape: np.ndarray
    ) -> np.ndarray:
        """Columns (N, L, C) with the column's mean slope (N,), per second, given."""
        steepness = (slope - settings[START]["slope"]) / settings["steepest_per_s"]
        each = np.repeat(np.clip(steepness, -SLOPE_REACH, SLOPE_REACH)[:, None, None], len(shape), axis=1)
        steps = step_columns(self.clipped(take, settings), take.own, settings)
        return np.concatenate([super().columns(take, settings, shape), each, steps], axis=2)

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> Mapping[str, np.ndarray]:
        """The column and how steeply it changes: together they tell how far the sensor is behind."""
        found = super().form_inputs(take, columns, settings)
        return found and {**found, f"slope of {self.column}": columns[:, :, -1]}

    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        return _SlowContextStream(self, settings, shape)

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.concatenate([super().prior_sd(settings), [PRIOR_DEG], step_prior_sd(settings)])

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        steepest = 60.0 * settings["steepest_per_s"]
        return (
            *super().weight_names(settings),
            f"offset_deg_per_{steepest:.3g}[c.{self.column}]_per_min",
            *step_names(settings, self.column),
        )


class _SlowContextStream(Stream):
    def __init__(self, effect: SlowContextEffect, settings: Settings, shape: np.ndarray) -> None:
        self._effect, self._settings, self._shape = effect, settings, shape
        self._start = ColumnStart(**settings[START])
        self._state: FollowedColumn | None = None
        self._last_s = 0.0

    def columns(self, frame: Signals) -> np.ndarray:
        time = float(frame.time_s[0])
        elapsed = time - self._last_s
        # A clock that was set back tells as little of what happened as a gap does.
        if self._state is None or not 0.0 <= elapsed <= LONGEST_GAP_S:
            self._state, elapsed = FollowedColumn(self._start), 0.0
        self._last_s = time
        value = frame.context.get(self._effect.column, np.full(1, np.nan))
        slope = self._state.run(np.array([elapsed]), np.asarray(value, dtype=float))
        return self._effect.with_slope(frame, slope, self._settings, self._shape)

    def reset(self) -> None:
        self._state = None
