"""Labels of a camera's pictures in the light that there is.

Colours are told by a table. Gains of red, green and blue, told from the last pictures of the glove, correct
them for the light; a table drawn for a hand and its pattern is drawn anew in that light.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import asdict

import numpy as np

from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.colour_glove.pictures.white_balance import Gains, blind_gains
from glovecal_models.colour_glove.pose.error_learning import drawn_colours
from glovecal_service.camera.tracking_setup import TrackingSetup

BALANCED_ON, APART_S = 4, 0.3
"""Pictures from which the light's gains are told, and how far apart they are at least."""


class CameraLight:
    """``gains`` are those of the light as it was told last; ones before."""

    def __init__(self) -> None:
        self.gains = Gains()
        self._in_this_light: ColourTable | None = None
        self._of_glove: deque[np.ndarray] = deque(maxlen=BALANCED_ON)
        self._of_glove_s = 0.0

    def labels(self, pixels: np.ndarray, setup: TrackingSetup) -> np.ndarray:
        """Of a picture (H, W, 3); one that is labels already (H, W) comes back as it is."""
        if pixels.ndim == 2:
            return pixels
        now = time.monotonic()
        if now - self._of_glove_s >= APART_S:
            self._of_glove_s = now
            self._of_glove.append(pixels)
        if self._in_this_light is not None:
            return self._in_this_light.labels(pixels)
        return setup.colours.labels(self.gains.corrected(pixels))

    def balance(self, setup: TrackingSetup, *, own_colours: bool) -> dict[str, float]:
        """Gains from the last pictures, with the mean distance of labels to the hand's before and after,
        px squared. ``own_colours``: the table is from pictures and cannot be drawn in another light.

        Raises BadInput.
        """
        gains, distance, before = blind_gains(list(self._of_glove), setup.colours, setup.first.lookup)
        self.gains, self._in_this_light = gains, None if own_colours else drawn_colours(setup.hand, gains)
        return {**asdict(gains), "distance_px2": distance, "distance_before_px2": before}
