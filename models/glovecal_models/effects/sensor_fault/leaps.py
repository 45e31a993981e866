"""Leaps: one sensor's readings switch by themselves between levels, and back.

A cold solder joint sits in one of two states and changes between them at random (random telegraph signal); a
cracked track parts in a bend and closes again. From one frame to the next the reading goes elsewhere, its
joint does not. Against the curve of the joint's own angle such a leap is a step between two means; what a
movement leaves of another effect is a slope there, which takes many frames. A step also tells by a least
squares fit beside a slope: of a leap all is left, of a slope nothing. Leaps to and fro take turns, and the
other sensors have none: a cloth that slips, a frame that is repeated, a touch move more than one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.sensor_fault.reading_errors import ReadingErrors

SIDE_S, SIDE_FRAMES = 0.12, 4
"""Each mean is over so long, and at least so many frames."""
SPREADS = 4.0
"""Times the robust spread of the differences of means."""
LEAST_DEG = 1.0
FEWEST = 12
STEP_SHARE = 0.85
"""Of the difference of means, which the step beside a slope must be; on 150 simulated gloves with other
effects of 2.6 noise floors a single sensor had at most 0.83, or leapt without taking turns."""
TURNS = 0.65
"""Share of the leaps that go the other way than the one before; half would be chance."""
OTHERS_LEAPS, OTHERS_SHARE = 0.25, 0.25
"""At most this share of the other sensors may have more than this share of the leaps."""


@dataclass(frozen=True)
class Leaps:
    """Of one sensor."""

    count: int
    size_deg: float
    """Their mean height."""


@dataclass(frozen=True)
class _Candidates:
    heights: list[np.ndarray]
    """For each take the differences of means, degrees."""
    step_share: float

    @property
    def count(self) -> int:
        return sum(map(len, self.heights))

    @property
    def size_deg(self) -> float:
        return float(np.mean(np.abs(np.concatenate(self.heights))))

    @property
    def turns(self) -> float:
        pairs = [np.sign(each[1:]) != np.sign(each[:-1]) for each in self.heights]
        every = np.concatenate(pairs)
        return float(every.mean()) if len(every) else 0.0

    @property
    def are_leaps(self) -> bool:
        return (
            self.count >= FEWEST
            and self.step_share >= STEP_SHARE
            and self.turns >= TURNS
            and self.size_deg >= LEAST_DEG
        )


def leaps(sensors: Sequence[ReadingErrors | None]) -> list[Leaps | None]:
    """For each sensor its leaps, None where they are no fault of its own."""
    found = [None if each is None else _candidates(each) for each in sensors]
    counts = np.array([0 if each is None else each.count for each in found])
    result: list[Leaps | None] = []
    for place, each in enumerate(found):
        others = np.delete(counts, place)
        many = int((others > OTHERS_LEAPS * counts[place]).sum())
        is_own = each is not None and each.are_leaps and many <= OTHERS_SHARE * len(others)
        result.append(Leaps(each.count, each.size_deg) if each and is_own else None)
    return result


def _candidates(sensor: ReadingErrors) -> _Candidates | None:
    side = max(SIDE_FRAMES, round(SIDE_S * sensor.rate_hz))
    place = np.arange(2 * side) - (side - 0.5)
    means = np.where(place > 0, 1.0, -1.0) / side
    beside_slope = np.linalg.pinv(np.column_stack([np.ones(2 * side), place, (place > 0)]))[2]
    long = [error for error in sensor.errors if len(error) >= 2 * side]
    if not long:
        return None
    known = np.concatenate([np.correlate(error, means, "valid") for error in long])
    known = np.abs(known[np.isfinite(known)])
    if not len(known):
        return None
    limit = SPREADS * 1.4826 * float(np.median(known))
    heights, steps = [], []
    for error in long:
        height = np.correlate(error, means, "valid")
        size = np.where(np.isfinite(height), np.abs(height), 0.0)
        peaks = [
            at
            for at in np.flatnonzero(size > limit)
            if size[at] >= size[max(at - side, 0) : at + side + 1].max()
        ]
        heights.append(height[peaks])
        steps += [float(np.sign(height[at]) * (beside_slope @ error[at : at + 2 * side])) for at in peaks]
    if not steps:
        return None
    return _Candidates(heights, float(np.mean(steps) / np.mean(np.abs(np.concatenate(heights)))))
