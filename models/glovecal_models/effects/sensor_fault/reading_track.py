"""Where sensors are heading: level and slope of each, from its good readings alone.

A finger's speed changes little from frame to frame, so that a reading is foretold far better from level and
slope than from the reading before (alpha-beta filter, Kalata 1984).
"""

from __future__ import annotations

import numpy as np

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
