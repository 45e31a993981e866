"""The letter nearest to a hand, in standard deviations of its joints.

Far from all letters, or nearer to the relaxed hand, it is no letter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spelling.alphabet import LETTERS, LETTERS_DEG, REST_ANGLES_DEG

SHAPE_SD_DEG = 8.0
"""How much one person's letter differs from the table's, for each joint; assumed."""
FAR = 1.8
"""Root mean square distance in standard deviations beyond which a hand shows no letter."""
NO_LETTER = len(LETTERS)
_SHAPES_DEG = np.vstack([LETTERS_DEG, REST_ANGLES_DEG])


class Nearest(NamedTuple):
    letter: str | None
    """None when ``distance`` is over ``FAR``, and for the relaxed hand."""
    distance: float
    """To the nearest letter: root mean square over joints, in standard deviations."""
    second: str
    """The letter that would be next."""


def letter_distances(angles_deg: np.ndarray, deviations_deg: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(N, 25): root mean square distances in standard deviations from hands to letters and relaxed hand.

    ``angles_deg`` and ``deviations_deg`` (N, R): an uncertain joint counts less, by the deviation that its
    pose states. ``measured`` (R,) bool: joints that no glove measured do not count.
    """
    variances = np.asarray(deviations_deg)[:, None] ** 2 + SHAPE_SD_DEG**2
    squares = (np.asarray(angles_deg)[:, None] - _SHAPES_DEG) ** 2 / variances
    return np.sqrt(squares[:, :, measured].mean(axis=2))


def nearest_letter(angles_deg: np.ndarray, deviations_deg: np.ndarray, measured: np.ndarray) -> Nearest:
    """All (R,). Raises ValueError when no rotation was measured."""
    if not measured.any():
        raise ValueError("no rotation of the hand is measured; a letter needs some")
    distances = letter_distances(angles_deg[None], deviations_deg[None], measured)[0]
    first = int(distances.argmin())
    letter = LETTERS[first] if distances[first] <= FAR and first != NO_LETTER else None
    order = [LETTERS[place] for place in np.argsort(distances[:NO_LETTER], kind="stable")]
    second = next(each for each in order if each != letter)
    return Nearest(letter, float(distances[first]), second)
