"""What each effect of a model adds to each angle, written down while the correction is worked out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.effects.base.signature_effect import Held

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
        effect = item.effect
        for name in dict.fromkeys(wearing):
            claimed = effect.uncertainty(item.settings, item.weights, name)
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
