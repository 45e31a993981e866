"""Effects of a recorded context column: an offset and a gain that change with it, at once or late.

A sensor that takes minutes T to take up what surrounds it feels h - T s, where s is the column's mean slope
over the past minutes (``FollowedColumn``); inside a take the second part is often the larger one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np

from glovecal_models.effects.base.column_steps import (
    IN_STEPS,
    ColumnSteps,
    step_columns,
    step_names,
    step_prior_sd,
)
from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.dynamics import LONGEST_GAP_S, InstantEffect, elapsed_s, unbroken
from glovecal_models.effects.base.effect import FormSignals, FurtherColumns, Stream
from glovecal_models.effects.base.facts import Weights
from glovecal_models.effects.base.relaxation import relax
from glovecal_models.effects.base.signals import Settings, Signals, fit_joint_units, in_joint_units

PRIOR_DEG = 4.0
SQUARE_PRIOR_DEG = 6.0
BEYOND_SHARE = 0.3
"""Of the range seen in training: so far a slope goes on, for the next take is seldom inside all others."""


class KeptSteps(FurtherColumns):
    """The steps of a column, once they were searched in all takes."""

    def with_found(self, settings: Settings, stored: Settings) -> Settings:
        steps = ColumnSteps.of_settings(stored)
        return settings if steps is None else {**settings, **steps.to_settings()}

    def as_stored(self, takes: Sequence[Signals], settings: Settings, stored: Settings) -> Settings:
        return self.with_found(settings, stored)


class ContextEffect(InstantEffect):
    """Columns h and h x joint, h a function of one context column, zero at that column's usual value.

    Well outside the range seen in training the column is held: no far extrapolation.
    """

    comparison: EffectComparison = EffectComparison("context of other takes")
    further: FurtherColumns = KeptSteps()
    has_any_form: bool = False
    """Whether the error may follow the column, which changes between takes, in any smooth form."""
    may_act_in_steps: bool = False
    """Whether firmware may correct it by a table of the column (``column_steps``)."""

    @property
    def column(self) -> str:
        return self.context[0]

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        values = np.concatenate([take.context[self.column] for take in takes if self.column in take.context])
        values = values[np.isfinite(values)]
        return {
            "low": float(values.min()),
            "high": float(values.max()),
            "usual": float(np.median(values)),
            **fit_joint_units(takes),
        }

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        offsets = self.functions(self.clipped(take, settings), settings, shape)
        joint = in_joint_units(take.own, settings)[:, :, None]
        return np.concatenate([offsets, offsets * joint], axis=2)

    def clipped(self, take: Signals, settings: Settings) -> np.ndarray:
        """The context column (N,), its usual value where unknown, held near what training saw."""
        value = take.context.get(self.column)
        value = np.full(len(take), settings["usual"]) if value is None else value
        value = np.where(np.isfinite(value), value, settings["usual"])
        beyond = BEYOND_SHARE * (settings["high"] - settings["low"])
        return np.clip(value, settings["low"] - beyond, settings["high"] + beyond)

    def evenly(self, value: np.ndarray, settings: Settings) -> np.ndarray:
        """The column (N,) on a scale on which the effect is about as lively everywhere."""
        return value

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        if IN_STEPS in settings:
            return FormSignals()  # what a smooth curve would find between steps is chance
        value = self.clipped(take, settings)
        return FormSignals({self.column: np.repeat(value[:, None], take.own.shape[1], axis=1)})

    def functions(self, value: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        """(N, L, F) of the clipped context column (N,): its distance from the usual value, and the square."""
        span = max(settings["high"] - settings["low"], 1e-9)
        distance = (value - settings["usual"]) / span
        return np.repeat(np.column_stack([distance, distance**2])[:, None, :], len(shape), axis=1)

    def weights(self, settings: Settings) -> Weights:
        span = max(settings["high"] - settings["low"], 1e-9)
        per = f"{span:.3g}[c.{self.column}]"
        square = f"square_of_{per}"
        names = (
            f"offset_deg_per_{per}",
            f"offset_deg_per_{square}",
            f"gain_deg_per_{per}_and_sd",
            f"gain_deg_per_{square}_and_sd",
        )
        return Weights(names, (PRIOR_DEG, SQUARE_PRIOR_DEG, PRIOR_DEG, SQUARE_PRIOR_DEG))


STEEPEST_SHARE = 99.0
"""Percentile of the slopes in training: the unit of the slope's column."""
SLOPE_REACH = 1.5
"""Steeper ones are followed so far, in that unit: the next take is seldom inside all others."""
KNOWN_AFTER_S = 10.0
"""From then on the slope is as good as known: on simulated takes the error it leaves falls no further."""
TAKE_SD_DEG = 0.5
"""What came before the first frame is known by its slope only."""
START = "start"
"""Where settings keep how takes begin."""


class SlowContextEffect(ContextEffect):
    """Columns of the context column and its square, and one more: its mean slope over the past minutes.

    Two more where it acts in steps.
    """

    has_memory: bool = True
    has_any_form: bool = True
    may_act_in_steps: bool = True
    comparison: EffectComparison = EffectComparison("context of other takes", needs_movement=True)

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

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        """The column and how steeply it changes: together they tell how far the sensor is behind."""
        found = super().form_inputs(take, columns, settings)
        slope = {f"slope of {self.column}": columns[:, :, -1]} if found else {}
        return FormSignals({**found, **slope}, take_sd_deg=TAKE_SD_DEG)

    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        return _SlowContextStream(self, settings, shape)

    def weights(self, settings: Settings) -> Weights:
        usual, steepest = super().weights(settings), 60.0 * settings["steepest_per_s"]
        slope = f"offset_deg_per_{steepest:.3g}[c.{self.column}]_per_min"
        return Weights(
            (*usual.names, slope, *step_names(settings, self.column)),
            np.concatenate([usual.prior_sd, [PRIOR_DEG], step_prior_sd(settings)]),
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


# How far a sensor that follows a context column within minutes is behind it, frame by frame.
#
# To first order it feels f' = (h - f) / T and starts a take at h - T h', as a steady rise before would have
# left it. Takes are too short to tell T; (h - f) / T, the mean slope of the past minutes, hardly depends on
# it.
# The slope at the first frame decides, for the column's noise times T is an error. It is estimated
# anew with each frame, by Bayesian regression on a parabola through all frames since the start; until they
# tell
# anything it is the slope with which training takes usually begin.


FOLLOWS_S = 150.0
"""Cloth takes one to several minutes."""
START_LASTS_S = 60.0
"""Frames so long after the start tell how it began; a parabola holds no longer."""
FIRST_FRAME_S = 0.01
"""The first frame's value is as certain as the mean of so long a time."""
LEAST_START_FRAMES, LEAST_S, BLOCK_S = 20, 2.0, 1.0
EXPECTED_STEADY_TAKES = 2.0
"""Takes without any slope that are counted beside those of training: the mean of few is held near zero."""
LEAST = 1e-12
MOST_KEPT = 64
"""Takes whose slopes are remembered."""


@dataclass(frozen=True)
class ColumnStart:
    """How takes begin, in units of the column and seconds: what is expected of the next one."""

    noise: float
    """Spectral density: the variance of a mean over one second."""
    slope: float
    slope_sd: float
    curvature_sd: float

    @classmethod
    def of_takes(cls, takes: Sequence[tuple[np.ndarray, np.ndarray]]) -> ColumnStart:
        """``takes``: times and values (N,) of the column, NaN where unknown."""
        noises, slopes, curvatures = [], [], []
        for time_s, value in takes:
            for part in unbroken(time_s):
                found = _start(time_s[part], value[part])
                if found is not None:
                    noises.append(found[0])
                    slopes.append(found[1])
                    curvatures.append(found[2])
        if not slopes:
            return cls(1.0, 0.0, LEAST, LEAST)
        slope = float(np.sum(slopes)) / (len(slopes) + EXPECTED_STEADY_TAKES)
        spread = float(np.sqrt(np.mean((np.array(slopes) - slope) ** 2)))
        curved = float(np.sqrt(np.mean(np.square(curvatures))))
        return cls(max(float(np.mean(noises)), LEAST), slope, max(spread, LEAST), max(curved, LEAST))

    def to_settings(self) -> dict[str, float]:
        return asdict(self)


def _start(time_s: np.ndarray, value: np.ndarray) -> tuple[float, float, float] | None:
    """Noise, slope and curvature of one take's start, by a cubic; None where it is too short."""
    if not len(time_s):
        return None
    known = np.isfinite(value) & (time_s - time_s[0] <= START_LASTS_S)
    time, height = time_s[known], value[known]
    if len(time) < LEAST_START_FRAMES or time[-1] - time[0] < LEAST_S:
        return None
    time = time - time[0]
    end = time[-1]
    powers = np.vander(time / end, 4, increasing=True)
    found = np.linalg.lstsq(powers, height - height[0], rcond=None)[0]
    left = height - height[0] - powers @ found
    block = np.unique((time / BLOCK_S).astype(int), return_index=True)[1]
    counts = np.diff([*block.tolist(), len(time)])
    sums = np.add.reduceat(left, block)
    # The square of a sum over its count is the variance of one frame, or more where neighbours are alike.
    frame = float(np.sum(sums**2 / counts)) / len(block)
    return frame * end / len(time), float(found[1]) / end, 2.0 * float(found[2]) / end**2


class FollowedColumn:
    """State of one glove. Unknown values (NaN) tell nothing: the last known one is held."""

    def __init__(self, start: ColumnStart) -> None:
        self._start = start
        self._precision = np.diag(
            [FIRST_FRAME_S / start.noise, 1.0 / start.slope_sd**2, 1.0 / start.curvature_sd**2]
        )
        self._sums = np.zeros((3, 4))
        """Of squares and products of the parabola's terms, and of these with the column."""
        self._origin = np.nan
        self._passed_s = 0.0
        self._height = 0.0
        self._followed = np.zeros(1)

    def run(self, elapsed_s: np.ndarray, value: np.ndarray) -> np.ndarray:
        """(B,): mean slope per second after each of B frames, ``elapsed_s`` (B,) after one another."""
        result = np.full(len(value), self._start.slope)
        known = np.isfinite(value)
        first = 0
        if not np.isfinite(self._origin):
            if not known.any():
                return result
            first = int(known.argmax())
            self._origin = float(value[first])
            elapsed_s = elapsed_s.copy()
            elapsed_s[first] = 0.0
        result[first:] = self._run(elapsed_s[first:], value[first:], known[first:])
        return result

    def _run(self, elapsed_s: np.ndarray, value: np.ndarray, known: np.ndarray) -> np.ndarray:
        passed = np.cumsum(np.concatenate([[self._passed_s], elapsed_s]))[1:]
        held = np.maximum.accumulate(np.where(known, np.arange(len(value)), -1))
        height = np.where(held < 0, self._height, value[np.maximum(held, 0)] - self._origin)
        followed = relax(self._followed, elapsed_s, height[:, None], np.array([FOLLOWS_S]))[:, 0]
        weight = np.where(known & (passed <= START_LASTS_S), elapsed_s, 0.0) / self._start.noise
        terms = np.column_stack([np.ones(len(passed)), passed, passed**2 / 2])
        products = terms[:, :, None] * np.column_stack([terms, height])[:, None, :] * weight[:, None, None]
        sums = np.cumsum(np.concatenate([self._sums[None], products]), axis=0)[1:]
        right = sums[:, :, 3] + self._precision @ np.array([0.0, self._start.slope, 0.0])
        begin = np.linalg.solve(sums[:, :, :3] + self._precision, right[:, :, None])[:, :, 0]
        self._sums, self._passed_s, self._height = sums[-1], float(passed[-1]), float(height[-1])
        behind = height - followed - np.exp(-passed / FOLLOWS_S) * (begin[:, 0] - FOLLOWS_S * begin[:, 1])
        return behind / FOLLOWS_S


def mean_slopes(time_s: np.ndarray, value: np.ndarray, start: ColumnStart) -> np.ndarray:
    """(N,) per second, not to be changed; a gap in the frames begins anew."""
    times, values = (np.asarray(part, dtype=float).tobytes() for part in (time_s, value))
    return _mean_slopes(times, values, start)


@lru_cache(maxsize=MOST_KEPT)
def _mean_slopes(times: bytes, values: bytes, start: ColumnStart) -> np.ndarray:
    """Of a take's column as bytes: all joints of a glove, one after the other, ask for the same."""
    time_s, value = np.frombuffer(times), np.frombuffer(values)
    elapsed = elapsed_s(time_s)
    result = np.zeros(len(time_s))
    for part in unbroken(time_s):
        if part.stop > part.start:
            result[part] = FollowedColumn(start).run(elapsed[part], value[part])
    result.flags.writeable = False
    return result
