"""Sensor faults seen live, frame by frame and without a reference.

Two signs, both against what the sensor did in training when nothing was wrong. It *jumps*: it is farther
from where it was heading than it ever came in that time. It *stands still* while the other sensors move, for
longer than it ever did. A jump is forgotten after ``LONGEST_JUMP_S``: by then the joint may be anywhere.

Where a sensor is heading are its level and slope, from its good readings alone: a finger's speed changes
little from frame to frame, so that a reading is predicted far better from both than from the reading before
(alpha-beta filter, Kalata 1984). Rotations whose sensor fails keep their last good angle, and grow uncertain
as fast as the joint moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from glovecal_models.effects.base.dynamics import LONGEST_GAP_S
from glovecal_models.effects.base.findings import Held, Hold
from glovecal_models.effects.base.signals import Settings

LEVEL_GAIN, SLOPE_GAIN = 0.6, 0.3
LONGEST_AHEAD_S = 0.1
"""A movement goes on as it was for so long; then the hand may as well have stopped."""


class ReadingTrack:
    """State of S sensors, strictly causal."""

    def __init__(self, time_s: float, readings: np.ndarray) -> None:
        self.last = readings.astype(float)
        """(S,), each sensor's last good reading, raw counts."""
        self.time_s = np.full(len(readings), float(time_s))
        """(S,), when it was."""
        self._level, self._slope = self.last.copy(), np.zeros(len(readings))

    def foretold(self, time_s: float) -> np.ndarray:
        """(S,) raw counts."""
        return self._level + self._slope * np.minimum(time_s - self.time_s, LONGEST_AHEAD_S)

    def take(self, time_s: float, readings: np.ndarray, is_good: np.ndarray) -> None:
        """The next frame's readings (S,), of which only the good ones are believed."""
        foretold, passed = self.foretold(time_s), np.maximum(time_s - self.time_s, 1e-3)
        surprise = readings - foretold
        level = foretold + LEVEL_GAIN * surprise
        slope = self._slope + SLOPE_GAIN * surprise / passed
        # After an absence the slope is old news.
        slope = np.where(passed > LONGEST_AHEAD_S, 0.0, slope)
        self._level = np.where(is_good, np.where(passed > LONGEST_AHEAD_S, readings, level), self._level)
        self._slope = np.where(is_good, slope, self._slope)
        self.last = np.where(is_good, readings, self.last)
        self.time_s = np.where(is_good, time_s, self.time_s)


LONGEST_JUMP_S = 0.5
MOVING_SHARE = 0.5
"""Of the other sensors, which must have changed since the frame before: else the hand may rest."""


@dataclass(frozen=True)
class FaultLimits:
    """What S sensors do when they are sound, and how far R rotations move meanwhile."""

    sensors: tuple[str, ...]
    lag_s: tuple[float, ...]
    """K times, the last ``LONGEST_JUMP_S``."""
    surprise_counts: tuple[tuple[float, ...], ...]
    """(S, K): how far a reading comes at most from what was foretold for it so long ago."""
    still_s: tuple[float, ...]
    """(S,): the longest time without a change while other sensors move."""
    rotations: tuple[str, ...]
    move_lag_s: tuple[float, ...]
    """M times."""
    move_deg: tuple[tuple[float, ...], ...]
    """(R, M): RMS by which a rotation changes within each of the times."""
    reads: tuple[tuple[str, ...], ...]
    """For each rotation the sensors it is read from."""

    def to_settings(self) -> Settings:
        """Plain JSON-able data."""
        return asdict(self)

    @classmethod
    def of(cls, settings: Settings) -> FaultLimits:
        return cls(**{name: _tuples(value) for name, value in settings.items()})


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, (list, tuple)) else value


class FaultWatch:
    """The state of one glove's sensors, strictly causal."""

    def __init__(self, limits: FaultLimits, sensors: Sequence[str]) -> None:
        """``sensors``: the order of a frame's readings."""
        order = [limits.sensors.index(name) for name in sensors]
        surprises = np.array(limits.surprise_counts)[order]
        self._lags = np.concatenate([[0.0], limits.lag_s])
        self._surprises = np.column_stack([surprises[:, 0], surprises])
        self._still_s = np.array(limits.still_s)[order]
        self._lanes = np.arange(len(order))
        self.reset()

    def reset(self) -> None:
        """Forget: a new run or wearing."""
        self._last_s = -np.inf

    def frame(self, time_s: float, readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """For the next readings (S,): the last good ones, and how old each is, s; 0 for a sound sensor."""
        passed = time_s - self._last_s
        if not 0.0 < passed <= LONGEST_GAP_S:
            self._start(time_s, readings)
            passed = 0.0
        is_stuck = self._stands_still(time_s, readings, passed)
        elapsed = time_s - self._track.time_s
        is_away = np.abs(readings - self._track.foretold(time_s)) > self._largest_surprise(elapsed)
        self._track.take(time_s, readings, ~(is_stuck | is_away))
        self._last, self._last_s = readings.copy(), time_s
        # A sensor that stands still was last good when it began to.
        good_s = np.where(is_stuck, np.minimum(self._track.time_s, self._still_since), self._track.time_s)
        return self._track.last, time_s - good_s

    def _start(self, time_s: float, readings: np.ndarray) -> None:
        self._track, self._last = ReadingTrack(time_s, readings), readings.copy()
        self._still_since, self._still = np.full(len(readings), time_s), np.zeros(len(readings))

    def _stands_still(self, time_s: float, readings: np.ndarray, passed_s: float) -> np.ndarray:
        changed = readings != self._last
        others_move = changed.sum() - changed >= max(MOVING_SHARE * (len(readings) - 1), 1.0)
        self._still_since = np.where(changed, time_s, self._still_since)
        self._still = np.where(changed, 0.0, self._still + np.where(others_move, passed_s, 0.0))
        return self._still > self._still_s

    def _largest_surprise(self, elapsed_s: np.ndarray) -> np.ndarray:
        """(S,) counts; infinite when a sensor was away for too long to tell."""
        at = np.clip(np.searchsorted(self._lags, elapsed_s, side="left"), 1, len(self._lags) - 1)
        low, high = self._lags[at - 1], self._lags[at]
        share = np.clip((elapsed_s - low) / (high - low), 0.0, 1.0)
        before, after = self._surprises[self._lanes, at - 1], self._surprises[self._lanes, at]
        return np.where(elapsed_s > self._lags[-1], np.inf, before + share * (after - before))


class FaultHold(Hold):
    """By a ``FaultWatch`` of the readings."""

    def __init__(self, live: Settings, rotations: Sequence[str], sensors: Sequence[str]) -> None:
        """``live``: settings of ``FaultLimits``."""
        limits = FaultLimits.of(live)
        self._sensors = tuple(sensors)
        self._watch = FaultWatch(limits, sensors)
        self._reads = np.zeros((len(rotations), len(sensors)), dtype=bool)
        self._moves = np.zeros((len(rotations), len(limits.move_lag_s)))
        for name, moves, read in zip(limits.rotations, limits.move_deg, limits.reads, strict=True):
            if name in rotations:
                row = list(rotations).index(name)
                self._moves[row] = moves
                self._reads[row, [self._sensors.index(sensor) for sensor in read]] = True
        self._lags = np.array(limits.move_lag_s)
        self._last: np.ndarray | None = None

    def reset(self) -> None:
        self._watch.reset()
        self._last = None

    def frame(self, time_s: float, base: np.ndarray, readings: np.ndarray) -> Held:
        good, age_s = self._watch.frame(time_s, readings)
        fails = age_s > 0.0
        if self._last is None or not fails.any():
            self._last = base.copy()
            return Held(base, readings, np.zeros(len(base)), np.zeros(len(base), dtype=bool), ())
        is_faulty = np.any(self._reads & fails, axis=1)
        self._last = np.where(is_faulty, self._last, base)
        variance = np.zeros(len(base))
        for row in np.flatnonzero(is_faulty):
            oldest = float(age_s[self._reads[row]].max())
            variance[row] = np.interp(oldest, self._lags, self._moves[row]) ** 2
        names = tuple(name for name, failing in zip(self._sensors, fails, strict=True) if failing)
        return Held(self._last, np.where(fails, good, readings), variance, is_faulty, names)
