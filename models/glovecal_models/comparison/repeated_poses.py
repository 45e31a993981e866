"""The noise floor from poses that were held several times: how well does an error repeat itself?

A pose that comes back within one wearing gives nearly the same readings, so a model answers nearly the same
angle. How far the error of a repeat lies from the repeats before it, together with its spread inside the
repeat, is noise to any model that sees the present frame alone. The same joint in the same pose may still
have come from another side: hysteresis and slow drift are in it, and so is how exactly the pose was taken.

For k repeats with mean errors m_1 ... m_k the steps sqrt(j / (j + 1)) (m_(j+1) - mean(m_1 ... m_j)) are
independent and have the variance of one repeat; their squares add up to the spread around the pose's mean.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.floor_estimate import NoiseFloor, pooled
from glovecal_models.comparison.holds import Hold
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import TakeResiduals


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
