"""The stretches of a take in which a joint is held still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import TakeResiduals


@dataclass(frozen=True)
class Hold:
    """The error of a joint that is held, without the beginning of the hold."""

    frames: np.ndarray
    """Rows of the take."""
    time_s: np.ndarray
    error: np.ndarray
    predicted: np.ndarray
    hand_is_still: bool

    @property
    def freedom(self) -> int:
        return len(self.error) - 2

    def square(self, values: np.ndarray) -> float:
        """Sum of squares of ``values`` around their straight line: drift and creep are no noise."""
        time, values = self.time_s - self.time_s.mean(), values - values.mean()
        slope = float(time @ values) / float(time @ time)
        return float(np.sum((values - slope * time) ** 2))


def holds(item: TakeResiduals, column: int, limits: ComparisonLimits = COMPARISON_LIMITS) -> list[Hold]:
    """Where the joint of ``column`` is still, in the order of time."""
    frames = np.flatnonzero(np.isfinite(item.measured[:, column]) & np.isfinite(item.error[:, column]))
    time, angle, error = item.take.time_s[frames], item.measured[frames, column], item.error[frames, column]
    predicted, readings = item.predicted[frames, column], item.take.readings[frames]
    spread = readings.std(axis=0) if len(readings) else np.zeros(0)
    found = []
    start = 0
    while start < len(time):
        end = _end_of_hold(time, angle, start, limits.still_deg_per_s)
        if time[end - 1] - time[start] >= limits.shortest_hold_s:
            settled = int(np.searchsorted(time, time[start] + limits.settled_s))
            if end - settled >= limits.fewest_hold_frames:
                rows = slice(settled, end)
                still = _is_still(readings[rows], limits.still_share * spread)
                found.append(Hold(frames[rows], time[rows], error[rows], predicted[rows], still))
            start = end
        else:
            start += max(1, (end - start) // 2)
    return found


def _is_still(readings: np.ndarray, allowed: np.ndarray) -> bool:
    """Whether no sensor changes over a hold by more than is ``allowed`` (S,)."""
    thirds = np.array_split(readings, 3)
    moved = np.ptp([part.mean(axis=0) for part in thirds], axis=0)
    return bool((moved <= allowed).all())


def _end_of_hold(time: np.ndarray, angle: np.ndarray, start: int, still_deg_per_s: float) -> int:
    """One past the last frame up to which the angle stays on a slope too small for motion.

    Judged on means of neighbouring frames, so that the reference's own noise is not taken for motion.
    """
    step = max(1, int(np.searchsorted(time, time[start] + 0.1)) - start)
    end = min(start + step, len(time))
    before = angle[start:end].mean()
    while end < len(time):
        following = min(end + step, len(time))
        after = angle[end:following].mean()
        if abs(after - before) > still_deg_per_s * 0.1 or time[following - 1] - time[end - 1] > 0.5:
            break
        end, before = following, after
    return end
