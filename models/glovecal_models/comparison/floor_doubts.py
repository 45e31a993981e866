"""When a noise floor is not reliable: what holds and repeats say then is not the noise of the measurement.

* Clocks that disagree: while the reference says that a joint is still, the readings come from another moment.
* Few frames a second: the hand moves between any two of them.
* A wandering reference: it moves while no sensor does, which a hold's straight line takes out of the floor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from glovecal_models.comparison.holds import Hold
from glovecal_models.comparison.limits import ComparisonLimits
from glovecal_models.comparison.residuals import TakeResiduals
from glovecal_models.takes.take import Take

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
