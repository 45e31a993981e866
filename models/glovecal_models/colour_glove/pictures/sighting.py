"""The glove in a label image, looked up; a sleeve or a thing of one of its colours beside it is left out.

What belongs to the glove cannot go without the picture resembling hands less; without what does not belong to
it, the picture resembles them more. So where a picture is far from every entry of the database, its larger
pieces of one colour are left out one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from glovecal_models.colour_glove.crop import Window, glove_window, tiny_image
from glovecal_models.colour_glove.lookup import Neighbours, PoseLookup

STRANGE_PX2 = 8.0
"""Image distance: hands in photographs are nearer to one of 20,000 entries in nine of ten frames."""
MUCH_NEARER = 0.6
"""Of the distance with the piece. Leaving out a patch of the glove made it 1.3 times and more."""
LEAST_PIECE = 0.12
"""Of all pixels with a colour: a smaller sleeve moves the window little."""


@dataclass(frozen=True, eq=False)
class Sighting:
    labels: np.ndarray
    """(H, W) uint8, without what is no glove."""
    window: Window
    neighbours: Neighbours

    @classmethod
    def of(cls, labels: np.ndarray, lookup: PoseLookup) -> Sighting | None:
        """None where there is no glove. Raises BadInput for another kind of array."""
        found = _looked_up(labels, lookup)
        if found is None or found.distance_px2 <= STRANGE_PX2:
            return found
        best, least = found, MUCH_NEARER * found.distance_px2
        for without in _without_each_large_piece(labels):
            other = _looked_up(without, lookup)
            if other is not None and other.distance_px2 < least:
                best, least = other, other.distance_px2
        return best

    @property
    def distance_px2(self) -> float:
        """Image distance to the nearest entry, squared pixels of the tiny image."""
        return float(self.neighbours.distances[0])


def _looked_up(labels: np.ndarray, lookup: PoseLookup) -> Sighting | None:
    window = glove_window(labels)
    tiny = None if window is None else tiny_image(labels, window)
    if window is None or tiny is None or not tiny.any():
        return None
    return Sighting(labels, window, lookup.neighbours(tiny))


def _without_each_large_piece(labels: np.ndarray) -> list[np.ndarray]:
    pixels = np.bincount(labels.ravel(), minlength=2)
    pixels[0] = 0
    least = LEAST_PIECE * pixels.sum()
    found = []
    for colour in np.flatnonzero(pixels > least):
        # Neighbouring pixels of a dark sleeve may lack their colour.
        same = cv2.dilate((labels == colour).astype(np.uint8), np.ones((3, 3), np.uint8))
        _, pieces, sizes, _ = cv2.connectedComponentsWithStats(same, connectivity=8, ltype=cv2.CV_32S)
        piece = 1 + int(np.argmax(sizes[1:, cv2.CC_STAT_AREA]))
        own = (pieces == piece) & (labels == colour)
        if np.count_nonzero(own) > least:
            found.append(np.where(own, np.uint8(0), labels))
    return found
