"""Sensor faults seen live, frame by frame and without a reference.

Two signs, both against what the sensor did in training when nothing was wrong. It *jumps*: it is farther
from where it was heading than it ever came in that time. It *stands still* while the other sensors move, for
longer than it ever did. A jump is forgotten after ``LONGEST_JUMP_S``: by then the joint may be anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.history_effect import LONGEST_GAP_S
from glovecal_models.effects.sensor_fault.reading_track import ReadingTrack

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
