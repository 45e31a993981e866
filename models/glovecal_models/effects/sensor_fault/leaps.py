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
    away: tuple[np.ndarray, ...]
    """(N,) for each take: True where the sensor is off the level at which it is most of the time."""


@dataclass(frozen=True)
class _Candidates:
    frames: list[np.ndarray]
    """For each take the first frames after a step."""
    heights: list[np.ndarray]
    """Differences of means, degrees."""
    step_share: float

    @property
    def count(self) -> int:
        return sum(map(len, self.frames))

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
    for place, (each, sensor) in enumerate(zip(found, sensors, strict=True)):
        others = np.delete(counts, place)
        if (
            each is None
            or sensor is None
            or not each.are_leaps
            or (others > OTHERS_LEAPS * each.count).sum() > OTHERS_SHARE * len(others)
        ):
            result.append(None)
        else:
            result.append(Leaps(each.count, each.size_deg, _away(sensor.errors, each)))
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
    frames, heights, steps = [], [], []
    for error in sensor.errors:
        if len(error) < 2 * side:
            frames.append(np.empty(0, dtype=int))
            heights.append(np.empty(0))
            continue
        height = np.correlate(error, means, "valid")
        size = np.where(np.isfinite(height), np.abs(height), 0.0)
        peaks = [
            at
            for at in np.flatnonzero(size > limit)
            if size[at] >= size[max(at - side, 0) : at + side + 1].max()
        ]
        at = np.array(peaks, dtype=int)
        frames.append(at + side)
        heights.append(height[at])
        steps += [
            float(np.sign(height[first]) * (beside_slope @ error[first : first + 2 * side]))
            for first in peaks
        ]
    if not steps:
        return None
    return _Candidates(frames, heights, float(np.mean(steps) / np.mean(np.abs(np.concatenate(heights)))))


def _away(errors: Sequence[np.ndarray], found: _Candidates) -> tuple[np.ndarray, ...]:
    """Pieces between leaps whose level is further than half a leap from the usual one."""
    levels, lengths = [], []
    for error, frames in zip(errors, found.frames, strict=True):
        pieces = np.split(error, frames)
        known = [piece[np.isfinite(piece)] for piece in pieces]
        levels.append(np.array([np.median(piece) if len(piece) else np.nan for piece in known]))
        lengths.append(np.array([len(piece) for piece in pieces]))
    every, weight = np.concatenate(levels), np.concatenate(lengths)
    order = np.argsort(np.where(np.isfinite(every), every, np.inf))
    passed = np.cumsum(np.where(np.isfinite(every), weight, 0)[order])
    usual = every[order[int(np.searchsorted(passed, passed[-1] / 2))]]
    return tuple(
        np.repeat(np.abs(level - usual) > found.size_deg / 2, length)
        for level, length in zip(levels, lengths, strict=True)
    )
