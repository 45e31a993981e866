"""What a model's effects without columns add to its claimed variance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.correction_parts import CorrectionParts
from glovecal_models.effects.base.interval_effect import Interval, IntervalEffect


class VarianceInflation(NamedTuple):
    """Of one frame, or of N frames with N as the first axis."""

    variance: np.ndarray
    """(R,) degrees squared beside the claimed variance; negative where an effect explains noise."""
    is_faulty: np.ndarray
    """(R,) whether a sensor that the rotation is read from fails now; the angle is the last good one."""

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> VarianceInflation:
        """The claim as it is."""
        return cls(np.zeros(shape), np.zeros(shape, dtype=bool))

    @classmethod
    def more(cls, inflation: VarianceInflation | None, variance: np.ndarray) -> VarianceInflation:
        """``inflation``, or none yet, with ``variance`` of the same shape added."""
        if inflation is None:
            return cls(variance, np.zeros(variance.shape, dtype=bool))
        return cls(inflation.variance + variance, inflation.is_faulty)


class IntervalInflation:
    """All interval effects of one model together; without a state."""

    def __init__(
        self,
        effects: Sequence[AddedEffect],
        rotations: Sequence[str],
        sensors: Sequence[str],
        noise: np.ndarray,
    ) -> None:
        """``noise``: measurement noise of each of the R rotations, degrees squared, (R,)."""
        self.effects: list[IntervalEffect] = []
        self._parts: list[tuple[Interval, np.ndarray]] = []
        self._count = len(rotations)
        for item in effects:
            effect = item.effect
            lanes = [name for name in item.rotations if name in rotations]
            if isinstance(effect, IntervalEffect) and lanes:
                rows = np.array([list(rotations).index(name) for name in lanes])
                self.effects.append(effect)
                self._parts.append((effect.interval(item.settings, lanes, sensors, noise[rows]), rows))

    @property
    def is_empty(self) -> bool:
        return not self._parts

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(effect.name for effect in self.effects)

    def added_variance(
        self, since_start_s: np.ndarray, readings: np.ndarray, parts: CorrectionParts | None = None
    ) -> np.ndarray:
        """(N, R) degrees squared, for frames ``since_start_s`` (N,) after a start; ``readings`` (N, S)."""
        total = np.zeros((len(readings), self._count))
        for name, (interval, rows) in zip(self.names, self._parts, strict=True):
            added = interval.added_variance(since_start_s, readings)
            total[:, rows] += added
            if parts is not None:
                parts.widened(name, rows, added)
        return total
