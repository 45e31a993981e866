"""How far each rotation of the hand goes."""

from __future__ import annotations

import numpy as np

from glovecal_models.hand.rotations import HAND_ROTATIONS
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG

LIMITS_DEG = np.array([ACTIVE_RANGE_DEG[name] for name in HAND_ROTATIONS])
"""Lowest and highest angle, shape (R, 2), degrees."""


def clamped(angles_deg: np.ndarray) -> np.ndarray:
    """``angles_deg`` (..., R), none of them beyond its limit."""
    return np.clip(angles_deg, LIMITS_DEG[:, 0], LIMITS_DEG[:, 1])
