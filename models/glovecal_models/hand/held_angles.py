"""Angles of a whole hand from poses that come one by one, some of whose rotations cannot be used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.hand.rotations import completed
from glovecal_models.hand.skeleton import Skeleton


class HeldAngles:
    """An angle that cannot be used keeps its last usable value; what was never usable follows a rule, or
    rests."""

    def __init__(self) -> None:
        self._last: dict[str, float] = {}

    def angles_deg(
        self, skeleton: Skeleton, rotations: Sequence[str], degrees: np.ndarray, usable: np.ndarray
    ) -> np.ndarray:
        """(1, R) in the order of the skeleton's rotations, of the next pose: ``degrees`` (K,) and ``usable``
        (K,) bool of ``rotations``."""
        given = zip(rotations, degrees.tolist(), usable.tolist(), strict=True)
        self._last |= {name: angle for name, angle, is_usable in given if is_usable}
        return completed(list(self._last), np.array([list(self._last.values())]), skeleton.rotations)
