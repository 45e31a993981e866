"""The time since power-on: a context column that several parts know, and its own scale."""

from __future__ import annotations

import numpy as np

POWER_ON = "power_on_s"
"""The context column of seconds since the glove was switched on."""
SOON_S = 30.0
"""After power-on: before that a second counts as much as any other."""


def evenly_since_power_on(since_s: np.ndarray) -> np.ndarray:
    """On a scale on which what warms up is about as lively everywhere: the logarithm."""
    return np.log(np.maximum(since_s, 0.0) + SOON_S)
