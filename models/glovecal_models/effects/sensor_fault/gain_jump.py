"""A jump of gain or offset in the middle of a take: a plug that moved, an amplifier that switched.

The reading is fitted by a line in the reference. One line for the whole take, one line on each side of the
best moment, and one line that changes steadily with time: a jump is named only when two lines leave far less
than both others, and when the error steps right there from one frame to the next, as it does nowhere else,
and stays where it stepped to: noise comes back with the next frame. Postures that are held one after another
also look like two lines, but no hand changes posture in a frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.sensor_fault.short_faults import straight_line
from glovecal_models.takes.take_check import GAP_INTERVALS

SHORTEST_SIDE_S = 4.0
SEARCHED_FRAMES = 12
"""The best moment for two lines may be so far from the step."""
LEAST_DEG = 3.0
BETTER_THAN_ONE = 0.5
"""Share of the squared error of one line that two may leave."""
BETTER_THAN_DRIFT = 0.7
STEP_SHARE = 0.5
"""Of the change between the two lines at that angle: so much the step must reach, and the error keep."""
TYPICAL_SHARE = 0.7
"""Of the RMS of that change over the take, which the change at the step must reach."""
STEP_OVER_OTHERS = 1.3
"""The step over the largest ones elsewhere in the take (99.5 %)."""
AROUND_FRAMES = 6
STEP_OVER_AROUND = 2.0
"""The step over any other within so many frames: a quick movement takes several."""


@dataclass(frozen=True)
class GainJump:
    """Where and how much."""

    at_s: float
    size_deg: float
    """RMS of what the reading changes by over the take's angles, degrees."""
    left_of_one_line: float
    """Squared error with two lines over squared error with one."""


def gain_jump(
    time_s: np.ndarray, readings: np.ndarray, angles: np.ndarray, in_line: np.ndarray
) -> GainJump | None:
    """The largest jump of (N,) readings against (N,) reference degrees (NaN: not to be used), or None.

    ``in_line`` (N,) is False where a sensor may be saturated: such frames may show the step, but no line.
    """
    known = np.isfinite(angles) & in_line
    time, y, angle = time_s[known], readings[known], angles[known]
    if len(time) < 50 or time[-1] - time[0] < 2 * SHORTEST_SIDE_S or np.ptp(angle) < LEAST_DEG:
        return None
    spread = float(angle.std())
    x = (angle - angle.mean()) / spread
    answer, rest = straight_line(x, y)
    one = float(np.sum((y - answer * x - rest) ** 2))
    slope = abs(answer) / spread
    cut, two = _best_cut(time, x, y)
    if cut is None or slope <= 0 or two > BETTER_THAN_ONE * one:
        return None
    base = np.column_stack([np.ones_like(x), x])
    place = (2 * (time - time[0]) / (time[-1] - time[0]) - 1)[:, None]
    if two > BETTER_THAN_DRIFT * _left(np.column_stack([base, base * place]), y):
        return None
    before, after = (np.linalg.lstsq(base[side], y[side], rcond=None)[0] for side in _sides(cut, len(y)))
    change = base @ (after - before)
    # The slope across a jump mixes both sides; that of each side alone is the sensor's.
    slope = max(slope, 0.5 * (abs(before[1]) + abs(after[1])) / spread)
    size = float(np.sqrt(np.mean(change**2)) / slope)
    if size < LEAST_DEG:
        return None
    shown = np.isfinite(angles)
    every = np.column_stack([np.ones(shown.sum()), (angles[shown] - angle.mean()) / spread])
    error, change = readings[shown] - every @ before, every @ (after - before)
    at = int(np.searchsorted(time_s[shown], time[cut]))
    if not _is_abrupt(time_s[shown], error, readings[shown], change, at):
        return None
    return GainJump(float(time[cut]), size, two / max(one, 1e-300))


def _sides(cut: int, frames: int) -> tuple[slice, slice]:
    return slice(0, cut), slice(cut, frames)


def _left(columns: np.ndarray, y: np.ndarray) -> float:
    """Squared error of least squares."""
    weights = np.linalg.lstsq(columns, y, rcond=None)[0]
    return float(np.sum((y - columns @ weights) ** 2))


def _best_cut(time: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[int | None, float]:
    """The frame that starts the second line, and the squared error of both; from running sums."""
    centred = y - y.mean()
    terms = np.stack([np.ones_like(x), x, x * x, centred, x * centred, centred * centred])
    before = np.cumsum(terms, axis=1)
    left = _line_left(before) + _line_left(before[:, -1:] - before)
    allowed = (time - time[0] >= SHORTEST_SIDE_S) & (time[-1] - time >= SHORTEST_SIDE_S)
    if not allowed.any():
        return None, np.inf
    best = int(np.argmin(np.where(allowed, left, np.inf)))
    return best + 1, float(left[best])


def _line_left(sums: np.ndarray) -> np.ndarray:
    """Squared error of a line from the sums of 1, x, x², y, xy, y²."""
    n, x, xx, y, xy, yy = sums
    n = np.maximum(n, 1.0)
    sxx, sxy, syy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    return np.maximum(syy - np.where(sxx > 1e-9, sxy**2 / np.maximum(sxx, 1e-9), 0.0), 0.0)


def _is_abrupt(
    time: np.ndarray, error: np.ndarray, readings: np.ndarray, change: np.ndarray, cut: int
) -> bool:
    """Whether the error against the first line, and the reading, step near the cut by what the lines differ
    there; where the reading does not, the reference jumps."""
    elapsed = np.diff(time, prepend=time[:1])
    # Across frames that were left out a movement looks like a step.
    adjacent = elapsed <= GAP_INTERVALS * float(np.median(elapsed))
    steps = np.where(adjacent, np.abs(np.diff(error, prepend=error[:1])), 0.0)
    near = np.abs(np.arange(len(error)) - cut) <= SEARCHED_FRAMES
    at = int(np.argmax(np.where(near, steps, -1.0)))
    # Where the two lines cross, no step could be seen, and none is believed.
    typical = float(np.sqrt(np.mean(change**2)))
    expected = max(float(np.abs(change[near]).max()), TYPICAL_SHARE * typical)
    before, after = slice(max(at - AROUND_FRAMES, 0), at), slice(at, at + AROUND_FRAMES)
    around = np.concatenate([steps[before], steps[at + 1 : at + 1 + AROUND_FRAMES]])
    kept = abs(float(np.median(error[after]) - np.median(error[before]))) if at else 0.0
    if kept < STEP_SHARE * expected or not at:
        return False
    if (readings[at] - readings[at - 1]) * np.sign(error[at] - error[at - 1]) < STEP_SHARE * steps[at]:
        return False
    limit = max(
        STEP_SHARE * expected,
        STEP_OVER_OTHERS * float(np.percentile(steps[~near], 99.5)),
        STEP_OVER_AROUND * float(around.max()),
    )
    return bool(steps[at] >= limit)
