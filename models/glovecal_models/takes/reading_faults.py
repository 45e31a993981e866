"""Faults that one sensor's readings show by themselves: spikes, dropouts, and standing still.

All work on the readings (N,) of one sensor in one take and give a mask (N,) of the frames concerned.
"""

from __future__ import annotations

import numpy as np

SPIKE_SHARE = 0.08
"""Of the sensor's range: a smaller excursion may be a movement."""
SPIKE_SPREADS = 8.0
"""Times the robust spread of what a median over five frames takes away."""
JUMP_SHARE = 0.2
"""Of the range, within one frame: no finger does this."""
STUCK_S, STUCK_FRAMES = 1.0, 20
GRADUAL_SHARE = 0.04
"""Of the range: this close to an end a sensor that stands still may be saturated instead."""


def spikes(readings: np.ndarray, span: float) -> np.ndarray:
    """Excursions of one or two frames that come back; ``span`` is the sensor's range in readings."""
    if len(readings) < 5 or span <= 0:
        return np.zeros(len(readings), dtype=bool)
    from scipy.ndimage import median_filter  # slow to load, and every model with effects loads this file

    away = np.abs(readings - median_filter(readings, 5, mode="nearest"))
    spread = 1.4826 * float(np.median(away))
    limit = max(SPIKE_SPREADS * spread, 3.0 * smallest_step(readings), SPIKE_SHARE * span)
    found = away > limit
    # Where a level changes for good, the frames beside the step are no spikes.
    return found & ~_longer_than(found, 2)


def dropouts(readings: np.ndarray, span: float) -> np.ndarray:
    """Runs of two frames or more at one constant value, entered and left by a jump."""
    found = np.zeros(len(readings), dtype=bool)
    start, end = constant_runs(readings)
    if span <= 0:
        return found
    inside = (start > 0) & (end < len(readings))
    start, end = start[inside], end[inside]
    entered = np.abs(readings[start] - readings[start - 1])
    left = np.abs(readings[end] - readings[end - 1])
    jumps = np.minimum(entered, left) > JUMP_SHARE * span
    for first, after in zip(start[jumps], end[jumps], strict=True):
        found[first:after] = True
    return found


def stuck(time_s: np.ndarray, readings: np.ndarray, low: float, high: float, moved: np.ndarray) -> np.ndarray:
    """Runs of one value for a second or more, outside the ends of the range ``low`` to ``high``.

    ``moved`` (N,) is what the reference has travelled, in multiples of what must be seen; a run counts
    when it travels by one or more inside it.
    """
    found = np.zeros(len(readings), dtype=bool)
    margin = GRADUAL_SHARE * (high - low)
    never_changes = high <= low
    start, end = constant_runs(readings)
    lasts = (end - start >= STUCK_FRAMES) & (time_s[end - 1] - time_s[start] >= STUCK_S)
    within = (low + margin < readings[start]) & (readings[start] < high - margin)
    possible = lasts & (within | never_changes)
    for first, after in zip(start[possible], end[possible], strict=True):
        inside = moved[first:after]
        inside = inside[np.isfinite(inside)]
        found[first:after] = len(inside) > 1 and np.ptp(inside) >= 1.0
    return found


def constant_runs(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(R,) first frames of runs of two or more of one value, and (R,) the frames after them."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(readings) != 0) + 1, [len(readings)]])
    long = np.flatnonzero(np.diff(edges) >= 2)
    return edges[long], edges[long + 1]


def _longer_than(mask: np.ndarray, frames: int) -> np.ndarray:
    """The part of ``mask`` that stands in runs of more than so many frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    result = np.zeros(len(mask), dtype=bool)
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        result[start:end] = end - start > frames
    return result


def smallest_step(values: np.ndarray) -> float:
    """The quantum of (N,) values: their smallest change; 0 when they never change."""
    steps = np.abs(np.diff(values))
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return float(steps.min()) if len(steps) else 0.0
