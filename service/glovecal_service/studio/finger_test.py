"""Which sensors answer when a finger moves: readings against those of a still hand, in their own noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LEAST_STILL = 20
"""Readings of a hand held still before noise is known."""
LEAST_NOISE_COUNTS = 0.3
"""Of a converter that rounds to whole counts."""
ANSWERS_FROM = 8.0
"""Times its noise that a sensor has to move: of white noise known from ``LEAST_STILL`` readings, one in a
million comes so far."""
SHARE_OF_LARGEST = 0.4
"""Of the sensor that moved most, in times of noise: what moves less is pulled along."""
UNSTEADY = 2.0
"""Readings that wander this many times further than they differ from one to the next are of a moving hand."""


@dataclass(frozen=True)
class Answered:
    sensor: str
    moved_counts: float
    noise_counts: float

    @property
    def text(self) -> str:
        return f"{self.sensor} ({self.moved_counts:.0f} counts, noise {self.noise_counts:.1f})"


class FingerTest:
    """Readings of a still hand first, then those after the instruction; each of shape (S,), counts."""

    def __init__(self, sensors: Sequence[str]) -> None:
        self._sensors = tuple(sensors)
        self._still: list[np.ndarray] = []
        self.is_unsteady = False
        """Whether the hand moved when it was last held still."""
        self._rest = self.noise = self.moved = np.zeros(len(self._sensors))
        """Of each sensor: the mean of the still hand, its standard deviation, and how far it went since the
        instruction. Counts."""

    def hold(self, readings: np.ndarray) -> bool:
        """Of the hand held still; whether that is enough to begin. A hand that moved begins again."""
        self._still.append(np.asarray(readings, float))
        if len(self._still) < LEAST_STILL:
            return False
        still = np.array(self._still)
        step = np.std(np.diff(still, axis=0), axis=0) / np.sqrt(2)
        self._rest = still.mean(axis=0)
        self.noise = np.maximum(still.std(axis=0, ddof=1), LEAST_NOISE_COUNTS)
        self.is_unsteady = bool(np.any(self.noise > UNSTEADY * np.maximum(step, LEAST_NOISE_COUNTS)))
        if self.is_unsteady:
            self._still.clear()
        return not self.is_unsteady

    def move(self, readings: np.ndarray) -> None:
        """After the instruction."""
        self.moved = np.maximum(self.moved, np.abs(np.asarray(readings, float) - self._rest))

    def answered(self) -> tuple[list[Answered], list[Answered]]:
        """Sensors that answered, and those that were pulled along; the one that moved most is first."""
        times = self.moved / self.noise
        order = [int(place) for place in np.argsort(-times) if times[place] >= ANSWERS_FROM]
        moved = [
            (Answered(self._sensors[place], float(self.moved[place]), float(self.noise[place])), times[place])
            for place in order
        ]
        least = SHARE_OF_LARGEST * moved[0][1] if moved else 0.0
        return [item for item, far in moved if far >= least], [item for item, far in moved if far < least]
