"""What each effect of a model adds to each angle, written down while the correction is worked out.

What a model's effects without columns add to its claimed variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.effects.base.effect import IntervalEffect
from glovecal_models.effects.base.findings import Held, Interval

PartKind = Literal["held", "correction", "interval"]


@dataclass(frozen=True)
class CorrectionPart:
    """One effect's share in N frames of R rotations."""

    name: str
    kind: PartKind
    """It keeps the last good angle, adds columns, or changes the claimed interval alone."""
    degrees: np.ndarray
    """(N, R), added to the base's prediction."""
    variance: np.ndarray
    """(N, R), degrees squared, of what it adds; NaN where the model does not store it, negative where the
    effect explains what training took for noise."""
    claimed: np.ndarray
    """(N, R), degrees squared: how much of ``variance`` is in the claimed variance of the angle."""
    acts: np.ndarray
    """(N, R) bool: where it has anything to say."""


class CorrectionParts:
    """Of N frames, in the order in which the effects are asked."""

    def __init__(self, frames: int, rotations: int) -> None:
        self.found: list[CorrectionPart] = []
        self.faulty_sensors: list[tuple[str, ...]] = [()] * frames
        """For each frame those that fail."""
        self._shape = frames, rotations

    def of_frame(self, row: int) -> CorrectionParts:
        """Of one frame alone."""
        at = slice(row, row + 1)
        one = CorrectionParts(1, self._shape[1])
        one.faulty_sensors = self.faulty_sensors[at]
        one.found = [
            replace(
                part, degrees=part.degrees[at], variance=part.variance[at], claimed=part.claimed[at],
                acts=part.acts[at],
            )
            for part in self.found
        ]  # fmt: skip
        return one

    def held(self, name: str, frames: Sequence[Held], base: np.ndarray, first: int = 0) -> None:
        """``frames`` from row ``first`` on, held by an effect whose input was ``base`` (N, R), degrees."""
        part = next((one for one in self.found if (one.name, one.kind) == (name, "held")), None)
        if part is None:
            part = self._new(name, "held")
        for row, item in enumerate(frames, first):
            part.degrees[row] = item.base - base[row]
            part.variance[row] = part.claimed[row] = item.variance
            part.acts[row] = item.is_faulty
            self.faulty_sensors[row] = tuple(dict.fromkeys((*self.faulty_sensors[row], *item.sensors)))

    def widened(self, name: str, rows: np.ndarray, variance: np.ndarray) -> None:
        """``variance`` (N, L), degrees squared, on the L rotations of ``rows``."""
        part = self._new(name, "interval")
        part.variance[:, rows] = part.claimed[:, rows] = variance
        part.acts[:, rows] = True

    def corrected(
        self,
        item: AddedEffect,
        lanes: np.ndarray | slice,
        degrees: np.ndarray,
        variance: np.ndarray | None,
        base: np.ndarray,
        wearing: Sequence[str],
    ) -> None:
        """``degrees`` (N, L) with ``variance`` (N, L) of the weights, None where that is not stored;
        ``wearing`` is that of each frame, or one for all."""
        part = self._new(item.name, "correction")
        part.degrees[:, lanes] = degrees
        part.acts[:, lanes] = item.weights.any(axis=1)
        part.variance[:, lanes] = np.nan if variance is None else variance
        part.claimed[:, lanes] = 0.0 if variance is None else variance
        of_wearings = item.of_wearings
        for name in dict.fromkeys(wearing if of_wearings else ()):
            claimed = of_wearings.uncertainty(item.weights, name) if of_wearings else None
            if claimed is not None:
                rows = np.array([len(wearing) == 1 or one == name for one in wearing])
                rows = np.flatnonzero(np.broadcast_to(rows, len(base)))
                at = np.ix_(rows, np.arange(base.shape[1])[lanes])
                part.variance[at] = part.claimed[at] = claimed(base[at])

    def _new(self, name: str, kind: PartKind) -> CorrectionPart:
        degrees, variance, claimed = np.zeros((3, *self._shape))
        part = CorrectionPart(name, kind, degrees, variance, claimed, np.zeros(self._shape, dtype=bool))
        self.found.append(part)
        return part


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
        self.names: tuple[str, ...] = ()
        self._parts: list[tuple[Interval, np.ndarray]] = []
        self._count = len(rotations)
        for item in effects:
            effect = item.effect
            lanes = [name for name in item.rotations if name in rotations]
            if isinstance(effect, IntervalEffect) and lanes:
                rows = np.array([list(rotations).index(name) for name in lanes])
                self.names = (*self.names, effect.name)
                self._parts.append((effect.interval(item.settings, lanes, sensors, noise[rows]), rows))

    @property
    def is_empty(self) -> bool:
        return not self._parts

    @property
    def needing_time(self) -> tuple[str, ...]:
        """Names of those that grow with time."""
        return tuple(name for name, (each, _) in zip(self.names, self._parts, strict=True) if each.needs_time)

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
