"""How small an error can get on these measurements: what repeats by itself no better than this.

Three estimates, the best that the takes allow. While the whole hand is held still the error should not
move: its spread around each hold's line is noise of sensor and reference. Where only the joint itself is
held, a neighbour that pulls at its sensor is in it too. With too few holds only what differs from frame to
frame can be told, which is a lower bound: noise that lasts longer than a frame is not in it.

The floor is that of this model: one that follows its sensors too closely magnifies their noise. How much of
the floor is the prediction's own jitter is told beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from glovecal_models.comparison.residuals import Residuals, TakeResiduals

STILL_DEG_PER_S = 6.0
"""A joint that moves less than this over a hold is still."""
STILL_SHARE = 0.1
"""A sensor that changes by less than this share of its standard deviation is still."""
SHORTEST_HOLD_S = 0.5
SETTLED_S = 0.2
"""The beginning of a hold is left out: lag and creep are no noise."""
FEWEST_HOLDS = 4
RESAMPLES = 500
CHI_SQUARED_MEDIAN = 0.4549
"""With one degree of freedom."""


@dataclass(frozen=True)
class NoiseFloor:
    """The floor of one rotation with its 95 % interval, degrees."""

    floor_deg: float
    low_deg: float
    high_deg: float
    prediction_deg: float
    """What the prediction alone jitters by; the reference is the rest."""
    how: Literal["still hand", "still joint", "frame to frame"]
    holds: int

    @property
    def is_lower_bound(self) -> bool:
        return self.how == "frame to frame"


def noise_floor(found: Residuals, rotation: str, generator: np.random.Generator) -> NoiseFloor | None:
    """None when the rotation was measured in fewer than three frames."""
    column = found.column(rotation)
    holds = [hold for item in found.takes for hold in _holds(item, column)]
    still = [hold for hold in holds if hold.hand_is_still]
    if len(still) >= FEWEST_HOLDS:
        return _from_holds(still, "still hand", generator)
    if len(holds) >= FEWEST_HOLDS:
        return _from_holds(holds, "still joint", generator)
    return _from_differences(found, column, len(holds), generator)


@dataclass(frozen=True)
class _Hold:
    """The error of a joint that is held, without the beginning of the hold."""

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


def _from_holds(
    holds: list[_Hold], how: Literal["still hand", "still joint"], generator: np.random.Generator
) -> NoiseFloor:
    squares = np.array([hold.square(hold.error) for hold in holds])
    freedom = np.array([hold.freedom for hold in holds])
    drawn = generator.integers(0, len(holds), (RESAMPLES, len(holds)))
    resampled = np.sqrt(squares[drawn].sum(axis=1) / freedom[drawn].sum(axis=1))
    low, high = np.percentile(resampled, [2.5, 97.5])
    floor = float(np.sqrt(squares.sum() / freedom.sum()))
    jitter = np.sqrt(sum(hold.square(hold.predicted) for hold in holds) / freedom.sum())
    return NoiseFloor(floor, float(low), float(high), float(jitter), how, len(holds))


def _from_differences(
    found: Residuals, column: int, holds: int, generator: np.random.Generator
) -> NoiseFloor | None:
    """From second differences, which motion hardly enters; their variance is six times that of the noise."""
    means = _white_variances(np.concatenate([np.diff(item.error[:, column], 2) for item in found.takes]))
    if not len(means):
        return None
    drawn = generator.integers(0, len(means), (RESAMPLES, len(means)))
    low, high = np.sqrt(np.percentile(means[drawn].mean(axis=1), [2.5, 97.5]))
    predicted = np.concatenate([np.diff(item.predicted[:, column], 2) for item in found.takes])
    floor, jitter = (float(np.sqrt(np.mean(part))) for part in (means, _white_variances(predicted)))
    return NoiseFloor(floor, float(low), float(high), jitter, "frame to frame", holds)


def _white_variances(second: np.ndarray) -> np.ndarray:
    """Variance of the white noise in each of some 40 blocks of second differences, by their medians."""
    values = second[np.isfinite(second)] ** 2
    blocks = np.array_split(values, min(40, len(values))) if len(values) else []
    return np.array([np.median(block) for block in blocks]) / CHI_SQUARED_MEDIAN / 6.0


def _holds(item: TakeResiduals, column: int) -> list[_Hold]:
    """The stretches in which the joint is still."""
    time, angle, error = item.take.time_s, item.measured[:, column], item.error[:, column]
    usable = np.isfinite(angle) & np.isfinite(error)
    time, angle, error = time[usable], angle[usable], error[usable]
    predicted, readings = item.predicted[usable, column], item.take.readings[usable]
    spread = readings.std(axis=0) if len(readings) else np.zeros(0)
    found = []
    start = 0
    while start < len(time):
        end = _end_of_hold(time, angle, start)
        if time[end - 1] - time[start] >= SHORTEST_HOLD_S:
            settled = int(np.searchsorted(time, time[start] + SETTLED_S))
            if end - settled >= 5:
                rows = slice(settled, end)
                found.append(
                    _Hold(time[rows], error[rows], predicted[rows], _is_still(readings[rows], spread))
                )
            start = end
        else:
            start += max(1, (end - start) // 2)
    return found


def _is_still(readings: np.ndarray, spread: np.ndarray) -> bool:
    """Whether no sensor changes over a hold by more than a small share of what it does in the take."""
    thirds = np.array_split(readings, 3)
    moved = np.ptp([part.mean(axis=0) for part in thirds], axis=0)
    return bool((moved <= STILL_SHARE * spread).all())


def _end_of_hold(time: np.ndarray, angle: np.ndarray, start: int) -> int:
    """One past the last frame up to which the angle stays on a slope too small for motion.

    Judged on means of neighbouring frames, so that the reference's own noise is not taken for motion.
    """
    step = max(1, int(np.searchsorted(time, time[start] + 0.1)) - start)
    end = min(start + step, len(time))
    before = angle[start:end].mean()
    while end < len(time):
        following = min(end + step, len(time))
        after = angle[end:following].mean()
        if abs(after - before) > STILL_DEG_PER_S * 0.1 or time[following - 1] - time[end - 1] > 0.5:
            break
        end, before = following, after
    return end
