"""The shape a hand is believed to have before its fingertips are looked at, and how firmly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import HAND_ROTATIONS, completed

THUMB_SD_DEG, FINGER_SD_DEG = 15.0, 10.0
"""How far a hand is from its rest where nothing is known: the thumb is the less stiff (section 5.2.2)."""


@dataclass(frozen=True)
class HandShape:
    """N frames of K rotations, each normally distributed by itself (Wang & Neff 2013, equation 4).

    The inverse squares of ``sd_deg`` are the paper's stiffness coefficients.
    """

    rotations: tuple[str, ...]
    centre_deg: np.ndarray
    """(N, K)."""
    sd_deg: np.ndarray
    """(N, K)."""

    def __post_init__(self) -> None:
        shape = np.shape(self.centre_deg)
        if len(shape) != 2 or shape[1] != len(self.rotations) or np.shape(self.sd_deg) != shape:
            raise BadInput(
                f"a hand's shape has angles {shape} and standard deviations {np.shape(self.sd_deg)}, "
                f"expected (N, {len(self.rotations)}) for both"
            )
        if not np.isfinite(self.centre_deg).all() or not (np.asarray(self.sd_deg) > 0).all():
            raise BadInput("a hand's shape needs finite angles and standard deviations above 0 degrees")

    def __len__(self) -> int:
        return len(self.centre_deg)

    @classmethod
    def at_rest(cls, rotations: Sequence[str], frames: int = 1) -> HandShape:
        """A relaxed hand: what is left to say without a calibration."""
        rest = completed((), np.empty((1, 0)))[0]
        columns = [HAND_ROTATIONS.index(name) for name in rotations]
        firmness = [THUMB_SD_DEG if name.startswith("T") else FINGER_SD_DEG for name in rotations]
        return cls(tuple(rotations), np.tile(rest[columns], (frames, 1)), np.tile(firmness, (frames, 1)))

    def misfit(self, angles_deg: np.ndarray) -> np.ndarray:
        """How far hands (N, K) are from this shape, in standard deviations of the whole, (N,)."""
        return np.sqrt((((angles_deg - self.centre_deg) / self.sd_deg) ** 2).sum(axis=1))
