"""Readings and measured angles smoothed alike, so that a largest deviation is a movement and no noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.takes.take import Take

WINDOW_S = 0.15
"""Shorter than any movement a hand makes, long enough to average several frames."""
KEPT_HZ = 25.0
"""Smoothed frames beyond this many a second tell nothing new."""
NOISE_SD = 6.0
"""A sensor moved when its smoothed readings span more than this many standard deviations of its noise."""
WANDER_PER_CENT = 1.0
"""Largest and smallest readings leave out this share at either end: single frames do not make a range."""


@dataclass(frozen=True)
class SmoothTake:
    """A take without its pre-roll, smoothed over ``WINDOW_S`` and thinned."""

    take: Take
    time_s: np.ndarray
    """Shape (N,), seconds."""
    readings: np.ndarray
    """Shape (N, S), readings, in the order of the take's sensors."""
    angles: np.ndarray
    """Shape (N, R), degrees, NaN where not measured, in the order of the take's rotations."""
    noise: np.ndarray
    """Shape (S,): standard deviation that noise has left in the smoothed readings."""

    def reading(self, sensor: str) -> np.ndarray:
        return self.readings[:, self.take.sensors.index(sensor)]

    def angle(self, rotation: str) -> np.ndarray | None:
        """Degrees, shape (N,); None when fewer than half of the frames have it."""
        if rotation not in self.take.rotations:
            return None
        found = self.angles[:, self.take.rotations.index(rotation)]
        return found if np.isfinite(found).mean() > 0.5 else None

    def has_moved(self, sensor: str) -> bool:
        column = self.take.sensors.index(sensor)
        return span(self.readings[:, column]) > NOISE_SD * self.noise[column]


def smooth_take(take: Take) -> SmoothTake:
    """Of a take with at least one frame."""
    first = min(take.pre_roll_frames, len(take.time_s) - 1)
    time, readings = take.time_s[first:], take.readings[first:]
    angles = take.reference_at_frames(take.rotations)[first:]
    interval = float(np.median(np.diff(time))) if len(time) > 1 else WINDOW_S
    window = int(min(max(round(WINDOW_S / interval), 1), max(len(time) // 4, 1)))
    step = max(round(1 / (KEPT_HZ * interval)), 1)
    steps = np.diff(readings, axis=0) if len(time) > 1 else np.zeros((1, readings.shape[1]))
    noise = np.median(np.abs(steps), axis=0) / (0.6745 * np.sqrt(2) * np.sqrt(window))
    return SmoothTake(
        take,
        _averaged(time[:, None], window)[::step, 0],
        _averaged(readings, window)[::step],
        _averaged(angles, window)[::step],
        noise,
    )


def span(values: np.ndarray) -> float:
    """Between the two ends, without the outermost ``WANDER_PER_CENT``; NaNs left out, 0 for nothing."""
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0
    low, high = np.percentile(values, [WANDER_PER_CENT, 100 - WANDER_PER_CENT])
    return float(high - low)


def _averaged(columns: np.ndarray, window: int) -> np.ndarray:
    """Means over ``window`` rows each; a window with NaN is NaN."""
    if window == 1 or columns.shape[1] == 0:
        return columns[: len(columns) - window + 1]
    return np.lib.stride_tricks.sliding_window_view(columns, window, axis=0).mean(axis=-1)
