"""Where a joint is held still, and the noise floor from poses that were held several times.

A pose that is repeated within one wearing gives nearly the same readings, so a model predicts nearly the
same angle. The error of a repeat minus that of the repeats before it, and its variance inside the repeat,
are noise to any model of the present frame alone. Hysteresis, slow drift and inexact repetition are
included.

For k repeats with mean errors m_1 ... m_k the steps sqrt(j / (j + 1)) (m_(j+1) - mean(m_1 ... m_j)) are
independent and have the variance of one repeat; their squares add up to the spread around the pose's mean.

When a noise floor is not reliable: what holds and repeats say then is not the noise of the measurement.

* Clocks that disagree: while the reference says that a joint is still, the readings come from another moment.
* Few frames a second: the hand moves between any two of them.
* A wandering reference: it moves while no sensor does, which a hold's straight line takes out of the floor.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from glovecal_models.comparison.floor_estimate import NoiseFloor, pooled
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import TakeResiduals
from glovecal_models.takes.take import Take

HELD_STEP_S = 0.1
"""Neighbouring frames whose mean angles are compared."""
LONGEST_HELD_GAP_S = 0.5
FURTHEST_S = 1.5
SHIFT_S = 0.03
SHORTEST_S = 4.0
"""Of a take, below which nothing is said of its clocks."""
ROW_S = SHIFT_S
"""Between rows; more of them say nothing new of a shift."""
RIDGE = 1e-3
FEWEST_WANDERING = 4
"""Holds."""
MORE_THAN_SENSORS = 1.5
"""Times what the readings account for; less may be the sensors' own drift."""


@dataclass(frozen=True)
class Hold:
    """The error of a joint that is held, without the beginning of the hold."""

    frames: np.ndarray
    """Rows of the take."""
    time_s: np.ndarray
    error: np.ndarray
    predicted: np.ndarray
    measured: np.ndarray
    hand_is_still: bool

    @property
    def freedom(self) -> int:
        return len(self.error) - 2

    @cached_property
    def _time(self) -> tuple[np.ndarray, float]:
        """Seconds from the middle, (N,), and the sum of their squares."""
        time = self.time_s - self.time_s.mean()
        return time, float(time @ time)

    def square(self, values: np.ndarray) -> float:
        """Sum of squares of ``values`` around their straight line: drift and creep are no noise."""
        (time, square), values = self._time, values - values.mean()
        left = values - float(time @ values) / square * time
        return float(np.add.reduce(left * left))

    def drift_deg(self, values: np.ndarray) -> float:
        """How far the straight line of ``values`` goes over the hold."""
        time, square = self._time
        return float(time @ values) / square * float(time[-1] - time[0])


def holds(item: TakeResiduals, column: int, limits: ComparisonLimits = COMPARISON_LIMITS) -> list[Hold]:
    """Where the joint of ``column`` is still, in the order of time."""
    frames = np.flatnonzero(np.isfinite(item.measured[:, column]) & np.isfinite(item.error[:, column]))
    time, angle, error = item.take.time_s[frames], item.measured[frames, column], item.error[frames, column]
    predicted, is_whole = item.predicted[frames, column], len(frames) == len(item.take.time_s)
    readings = item.take.readings if is_whole else item.take.readings[frames]
    held: list[slice] = []
    start, track = 0, _Track.of(time, angle, limits)
    while start < len(time):
        early = track.early_end[start]
        if early:
            start += max(1, (early - start) // 2)
            continue
        end = track.end_of_hold(start, limits.still_deg_per_s)
        if time[end - 1] - time[start] >= limits.shortest_hold_s:
            settled = int(np.searchsorted(time, time[start] + limits.settled_s))
            if end - settled >= limits.fewest_hold_frames:
                held.append(slice(settled, end))
            start = end
        else:
            start += max(1, (end - start) // 2)
    if not held:
        return []
    spread = item.reading_spread if is_whole else readings.std(axis=0)
    still = _are_still(readings, held, limits.still_share * spread)
    return [
        Hold(frames[rows], time[rows], error[rows], predicted[rows], angle[rows], is_still)
        for rows, is_still in zip(held, still, strict=True)
    ]


def _are_still(readings: np.ndarray, held: Sequence[slice], allowed: np.ndarray) -> list[bool]:
    """For each hold whether no sensor changes over its rows of ``readings`` (N, S) by more than is
    ``allowed`` (S,): between the means of its thirds, of which the first have the rows that are left over."""
    size = np.array([rows.stop - rows.start for rows in held])
    counts = (size[:, None] + [2, 1, 0]) // 3
    ends = np.array([rows.start for rows in held])[:, None] + np.cumsum(counts, axis=1)
    # A last row of zeros: a hold may end with the take. The fourth sum of each is of what lies between holds.
    padded = np.concatenate([readings, np.zeros((1, readings.shape[1]))])
    edges = np.column_stack([ends - counts, ends[:, 2]]).ravel().astype(np.intp)
    sums = np.add.reduceat(padded, edges, axis=0).reshape(len(held), 4, -1)[:, :3]
    moved = np.ptp(sums / counts[:, :, None], axis=1)
    return (moved <= allowed).all(axis=1).tolist()


class _Track(NamedTuple):
    """Plain numbers, because holds are looked for frame by frame."""

    time_s: list[float]
    """Of N frames."""
    sums: list[float]
    """Of the angles of the first 0 to N frames, degrees."""
    step: list[int]
    """Of N frames: how many lie within the next ``HELD_STEP_S``."""
    early_end: list[int]
    """Of N frames: ``end_of_hold`` where that is too early for a hold, else 0."""

    @classmethod
    def of(cls, time_s: np.ndarray, angle: np.ndarray, limits: ComparisonLimits) -> _Track:
        start, sums = np.arange(len(time_s)), np.concatenate([[0.0], np.cumsum(angle)])
        step = np.maximum(1, np.searchsorted(time_s, time_s + HELD_STEP_S) - start)
        early = np.zeros(len(time_s), dtype=int)
        going, end = start, np.minimum(start + step, len(time_s))
        before = (sums[end] - sums[start]) / (end - start)
        while len(going):
            # As ``end_of_hold``, for all frames whose holds are not over yet and still too short.
            is_short = time_s[end - 1] - time_s[going] < limits.shortest_hold_s
            going, end, before = going[is_short], end[is_short], before[is_short]
            following = np.minimum(end + step[going], len(time_s))
            after = (sums[following] - sums[end]) / np.maximum(following - end, 1)
            is_over = np.abs(after - before) > limits.still_deg_per_s * HELD_STEP_S
            is_over |= time_s[following - 1] - time_s[end - 1] > LONGEST_HELD_GAP_S
            is_over |= end == len(time_s)
            early[going[is_over]] = end[is_over]
            going, end, before = going[~is_over], following[~is_over], after[~is_over]
        return cls(time_s.tolist(), sums.tolist(), step.tolist(), early.tolist())

    def end_of_hold(self, start: int, still_deg_per_s: float) -> int:
        """One past the last frame up to which the angle stays on a slope too small for motion.

        Judged on means of neighbouring frames, so that the reference's own noise is not taken for motion.
        """
        time, sums, step = self.time_s, self.sums, self.step[start]
        end = min(start + step, len(time))
        before = (sums[end] - sums[start]) / (end - start)
        while end < len(time):
            following = min(end + step, len(time))
            after = (sums[following] - sums[end]) / (following - end)
            if (
                abs(after - before) > still_deg_per_s * HELD_STEP_S
                or time[following - 1] - time[end - 1] > LONGEST_HELD_GAP_S
            ):
                break
            end, before = following, after
        return end


@dataclass(frozen=True)
class _Repeat:
    """One stay in a pose."""

    mean: float
    """Of the error, degrees."""
    within: float
    """Variance of the error inside the stay."""
    jitter: float
    """Variance of the prediction inside the stay."""


def from_repeated_poses(
    takes: Sequence[TakeResiduals],
    column: int,
    held: Sequence[Sequence[Hold]],
    generator: np.random.Generator,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> NoiseFloor | None:
    """``held``: the joint's holds in each take. None with too few repeats to compare."""
    stays: dict[tuple[str, str], list[_Repeat]] = defaultdict(list)
    for item, of_take in zip(takes, held, strict=True):
        for pose, rows in _stays(item, column, of_take, limits.shortest_hold_s):
            error, predicted = item.error[rows, column], item.predicted[rows, column]
            stays[item.take.wearing, pose].append(
                _Repeat(float(error.mean()), float(error.var()), float(predicted.var()))
            )
    squares = [value for repeats in stays.values() for value in _steps(repeats)]
    if len(squares) < limits.fewest_repeats:
        return None
    jitter = np.sqrt(np.mean([one.jitter for repeats in stays.values() for one in repeats]))
    return pooled(np.array(squares), np.ones(len(squares)), float(jitter), "repeated poses", generator)


def _steps(repeats: Sequence[_Repeat]) -> list[float]:
    """For each repeat but the first: its step's square and what it spreads by itself, degrees squared."""
    means = np.array([one.mean for one in repeats])
    found = []
    for j in range(1, len(repeats)):
        step = means[j] - means[:j].mean()
        found.append(float(step**2) * j / (j + 1) + repeats[j].within)
    return found


def _stays(
    item: TakeResiduals, column: int, held: Sequence[Hold], shortest_s: float
) -> list[tuple[str, np.ndarray]]:
    """Pose and frames of each stay in a pose.

    Of a stay the frames in which the joint is held; of one too short to tell, such as a single frame, all.
    """
    if item.take.poses is None:
        return []
    is_held = np.zeros(len(item.take.time_s), dtype=bool)
    for hold in held:
        is_held[hold.frames] = True
    time, poses = item.take.time_s, np.array(item.take.poses, dtype=object)
    changes = np.flatnonzero((poses[1:] != poses[:-1]) | (np.diff(time) > shortest_s)) + 1
    found = []
    for rows in np.split(np.arange(len(poses)), changes):
        is_short = time[rows[-1]] - time[rows[0]] < shortest_s
        still = rows[(is_held[rows] | is_short) & np.isfinite(item.error[rows, column])]
        if poses[rows[0]] and len(still):
            found.append((str(poses[rows[0]]), still))
    return found


def slow_sampling(takes: Sequence[TakeResiduals], limits: ComparisonLimits) -> tuple[str, ...]:
    """Ends of sentences about estimates from neighbouring frames."""
    times = [item.take.time_s for item in takes if len(item.take.time_s) > 2]
    rate = float(np.median([1.0 / np.median(np.diff(time)) for time in times])) if times else 0.0
    if not 0 < rate < limits.slowest_hz:
        return ()
    return (f"only {rate:.2g} frames a second were recorded",)


def clock_doubts(takes: Sequence[TakeResiduals], limits: ComparisonLimits) -> tuple[str, ...]:
    """Ends of sentences about every estimate."""
    apart = [_apart_s(item.take, item.measured, limits) for item in takes]
    judged = [one for one in apart if one is not None]
    moved = [one for one in judged if abs(one) >= limits.clock_least_s]
    if not moved or 2 * len(moved) < len(judged):
        return ()
    size = float(np.median(np.abs(moved)))
    return (
        f"the clocks are not repaired: readings and angles are {size:.2f} s apart in {len(moved)} of"
        f" {len(judged)} takes",
    )


def _apart_s(take: Take, measured: np.ndarray, limits: ComparisonLimits) -> float | None:
    """By how much the reference has to be moved to fit a straight line of all sensors best; 0 where that
    hardly helps, None where the take is too short or stands still to tell."""
    furthest = min(FURTHEST_S, 0.25 * take.duration_s)
    usable = np.flatnonzero(np.isfinite(measured).sum(axis=0) >= 0.8 * len(measured))
    if take.duration_s < SHORTEST_S or not len(usable):
        return None
    count = int(furthest / SHIFT_S)
    rows = np.arange(int((take.duration_s - 2 * furthest) / ROW_S))
    time = take.time_s[0] + furthest + ROW_S * rows
    moving = np.flatnonzero(np.ptp(take.readings, axis=0) > 0)
    if len(time) < 10 * (len(moving) + 1) or not len(moving):
        return None
    read = np.column_stack([np.interp(time, take.time_s, take.readings[:, at]) for at in moving])
    read = (read - read.mean(axis=0)) / np.maximum(read.std(axis=0), 1e-9)
    inverse = np.linalg.inv(read.T @ read + RIDGE * len(time) * np.eye(len(moving)))
    shifts = SHIFT_S * np.arange(-count, count + 1)
    every = time[0] + ROW_S * np.arange(-count, len(time) + count)
    left = np.zeros(len(shifts))
    for column in usable:
        known = np.isfinite(measured[:, column])
        angles = np.interp(every, take.time_s[known], measured[known, column])
        angles -= angles.mean()
        # The readings have no mean: what an angle's is does not matter to their products.
        crossed = np.ascontiguousarray(sliding_window_view(angles, len(time))) @ read
        square = _squares_about_means(angles, len(time))
        explained = np.einsum("dp,dp->d", crossed @ inverse, crossed)
        left += 1.0 - explained / np.maximum(square, 1e-9)
    best = int(np.argmin(left))
    saved = 1.0 - left[best] / max(left[count], 1e-12)
    return float(shifts[best]) if saved >= limits.clock_least_share else 0.0


def _squares_about_means(values: np.ndarray, width: int) -> np.ndarray:
    """Of each window of ``width`` values (N,), (N - width + 1,): the sum of squares about its mean."""
    sums, squares = (np.concatenate([[0.0], np.cumsum(part)]) for part in (values, values**2))
    means = (sums[width:] - sums[:-width]) / width
    return np.maximum(squares[width:] - squares[:-width] - width * means**2, 0.0)


def hold_doubts(still: Sequence[Hold], floor_deg: float, limits: ComparisonLimits) -> tuple[str, ...]:
    """Of one rotation; ``still``: its holds in which no sensor moves."""
    if len(still) < FEWEST_WANDERING:
        return ()
    angle = [hold.drift_deg(hold.measured) for hold in still]
    error = [hold.drift_deg(hold.error) for hold in still]
    mapped = [one + other for one, other in zip(angle, error, strict=True)]
    moves, misses, follows = (float(np.sqrt(np.mean(np.square(each)))) for each in (angle, error, mapped))
    if misses < limits.wander_times * floor_deg or moves < MORE_THAN_SENSORS * follows:
        return ()
    return (f"the reference wanders: {moves:.2f} degrees within holds in which no sensor moves",)
