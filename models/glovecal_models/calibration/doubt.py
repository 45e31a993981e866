"""How far effects trust a prediction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Doubt(NamedTuple):
    """Of one frame, or of N frames with N as the first axis."""

    variance: np.ndarray
    """(R,) degrees squared beside the claimed variance; negative where an effect explains noise."""
    is_faulty: np.ndarray
    """(R,) whether a sensor that the rotation is read from fails now; the angle is the last good one."""

    @classmethod
    def more(cls, doubt: Doubt | None, variance: np.ndarray) -> Doubt:
        """``doubt``, or none yet, with ``variance`` of the same shape added."""
        if doubt is None:
            return cls(variance, np.zeros(variance.shape, dtype=bool))
        return cls(doubt.variance + variance, doubt.is_faulty)
