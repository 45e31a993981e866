"""What the protocol sees of a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False, slots=True)
class GloveReading:
    time_s: float
    """The capture computer's monotonic clock, as in the recording."""
    sequence: int
    run: str
    """One start of the capture daemon."""
    values: np.ndarray
    """Raw readings, shape (S,)."""
    button: bool = False
