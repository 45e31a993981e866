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

    def degrees(
        self, skeleton: Skeleton, rotations: Sequence[str], degrees: np.ndarray, usable: np.ndarray
    ) -> list[float]:
        """Of the next pose, in the order of the skeleton's rotations: ``degrees`` (K,) and ``usable`` (K,)
        bool of ``rotations``."""
        given = zip(rotations, degrees.tolist(), usable.tolist(), strict=True)
        self._last |= {name: angle for name, angle, is_usable in given if is_usable}
        try:
            return [self._last[name] for name in skeleton.rotations]
        except KeyError:
            known = np.array([list(self._last.values())])
            return completed(list(self._last), known, skeleton.rotations)[0].tolist()
