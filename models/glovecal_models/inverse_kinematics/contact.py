"""What fingertips are known to do: touch, hold a rod, or be at given places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput

ROD_MM = (5.0, 200.0)
"""Lengths of rods that two fingertips can hold."""
SAME_PLACE_MM = 1e-9
"""Tips this close have no direction from one to the other."""


class Contact(Protocol):
    """A condition on the tips of ``fingers``, told as G vectors of C components that should be zero."""

    @property
    def fingers(self) -> tuple[str, ...]:
        """Letters of ``FINGERS``; the tips given to ``missing`` are in this order."""
        ...

    def missing(self, tips_mm: np.ndarray, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """What is still to go in ``frame``, (G, C) mm, and its rows (G, C, F, 3) on the tips (F, 3).

        Where tips move by ``d`` (F, 3), what is to go falls by ``rows`` times ``d``.
        """
        ...


@dataclass(frozen=True)
class Touch:
    """Two fingertips in one place."""

    fingers: tuple[str, str]

    def missing(self, tips_mm: np.ndarray, frame: int) -> tuple[np.ndarray, np.ndarray]:
        return (tips_mm[1] - tips_mm[0])[None], _APART


@dataclass(frozen=True)
class Rod:
    """Two fingertips at the ends of a rod (Wang & Neff 2013, section 9: accuracy where tips are apart)."""

    fingers: tuple[str, str]
    length_mm: float

    def __post_init__(self) -> None:
        low, high = ROD_MM
        if not low <= self.length_mm <= high:
            raise BadInput(f"a rod of {self.length_mm:g} mm; rods are {low:g} to {high:g} mm long")

    def missing(self, tips_mm: np.ndarray, frame: int) -> tuple[np.ndarray, np.ndarray]:
        apart = tips_mm[0] - tips_mm[1]
        distance = max(float(np.sqrt(apart @ apart)), SAME_PLACE_MM)
        along = (apart / distance)[None, None]
        return np.array([[self.length_mm - distance]]), np.stack([along, -along], axis=2)


@dataclass(frozen=True)
class TipPlaces:
    """Fingertips at places that are known in each frame, seen from the palm."""

    fingers: tuple[str, ...]
    places_mm: np.ndarray
    """(N, F, 3), in the skeleton's frame with the wrist straight."""

    def missing(self, tips_mm: np.ndarray, frame: int) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.fingers)
        rows = np.eye(3 * count).reshape(count, 3, count, 3)
        return self.places_mm[frame] - tips_mm, rows


_APART = np.stack([np.eye(3), -np.eye(3)], axis=1)[None]
