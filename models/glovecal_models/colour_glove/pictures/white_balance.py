"""The light's colour taken out of a picture: by something white in it, or by what makes the glove plausible.

A camera that was not balanced for its light multiplies red, green and blue by other numbers. A white
reference tells them; without one, those gains of red and blue are searched for with which the glove's tiny
images come nearest to the database (ours; relearning the colours from the tracker's own answers collapses).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from glovecal_models.colour_glove.crop import glove_window, tiny_image
from glovecal_models.colour_glove.lookup import PoseLookup
from glovecal_models.colour_glove.palette import encoded_light, linear_light
from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.errors import BadInput

WEAKEST, STRONGEST = 0.3, 3.0
"""Gains that are believed."""
_SEARCHED = np.exp(np.linspace(-0.5, 0.5, 11))
_WHITE_LEVEL = (60.0, 250.0)
"""Of a white reference: darker is no white, brighter is cut off."""
_MISSING = 150.0
"""Image distance of a picture in which no glove is seen, squared pixels: more than the largest."""


@dataclass(frozen=True)
class Gains:
    """What a picture is multiplied by, in linear light. Raises BadInput for gains that nobody believes."""

    red: float = 1.0
    green: float = 1.0
    blue: float = 1.0

    def __post_init__(self) -> None:
        given = (self.red, self.green, self.blue)
        if not all(WEAKEST <= gain <= STRONGEST for gain in given):
            raise BadInput(f"gains {given} of red, green, blue; each must be {WEAKEST} to {STRONGEST}")

    def corrected(self, picture: np.ndarray) -> np.ndarray:
        """The picture (H, W, 3) uint8 blue, green, red with its light changed."""
        return cv2.LUT(picture, self._table)

    @cached_property
    def _table(self) -> np.ndarray:
        light = linear_light(np.arange(256))
        channels = [encoded_light(light * gain) for gain in (self.blue, self.green, self.red)]
        return np.ascontiguousarray(np.stack(channels, axis=1)[None])


def white_gains(picture: np.ndarray, white: np.ndarray) -> Gains:
    """Gains that make the pixels of ``white`` (H, W) bool grey, as bright as their green is.

    Raises BadInput when they are too few, too dark, cut off, or of several brightnesses.
    """
    if white.shape != picture.shape[:2]:
        raise BadInput(f"a mask {white.shape} of a picture {picture.shape}")
    pixels = picture[white].astype(float)
    if len(pixels) < 20:
        raise BadInput(f"{len(pixels)} pixels of white; at least 20 are needed")
    low, high = _WHITE_LEVEL
    middle = np.median(pixels, axis=0)
    if middle.min() < low or middle.max() > high:
        raise BadInput(
            f"the white reference has levels {middle.round().astype(int).tolist()} (blue, green, red) "
            f"of 255; expected {low:.0f} to {high:.0f}: change the exposure"
        )
    if pixels.std(axis=0).max() > 0.25 * middle.max():
        raise BadInput(
            "the white reference is not of one brightness: is it in half shade, or something else?"
        )
    blue, green, red = linear_light(middle)
    return Gains(float(green / red), 1.0, float(green / blue))


def blind_gains(
    pictures: Sequence[np.ndarray], table: ColourTable, lookup: PoseLookup
) -> tuple[Gains, float, float]:
    """Gains of red and blue with which a few pictures of the glove come nearest to the database.

    Returns them, and the mean image distance (squared pixels) with and without. Raises BadInput for no
    picture, and when no gains show a glove.
    """
    if not pictures:
        raise BadInput("gains are searched for in at least one picture; none was given")

    def distance(gains: Gains) -> float:
        found = []
        for picture in pictures:
            labels = table.labels(gains.corrected(picture))
            window = glove_window(labels)
            tiny = None if window is None else tiny_image(labels, window)
            seen = tiny is not None and np.count_nonzero(tiny) > 0.1 * tiny.size
            found.append(
                float(lookup.neighbours(tiny, 1).distances[0]) if tiny is not None and seen else _MISSING
            )
        return float(np.mean(found))

    # First every other gain, then around the best of them.
    tried: dict[tuple[int, int], float] = {}

    def at(red: int, blue: int) -> float:
        if (red, blue) not in tried:
            tried[red, blue] = distance(Gains(float(_SEARCHED[red]), 1.0, float(_SEARCHED[blue])))
        return tried[red, blue]

    count = len(_SEARCHED)
    best = min(
        ((red, blue) for red in range(1, count, 2) for blue in range(1, count, 2)), key=lambda p: at(*p)
    )
    around = [
        (red, blue)
        for red in range(max(0, best[0] - 1), min(count, best[0] + 2))
        for blue in range(max(0, best[1] - 1), min(count, best[1] + 2))
    ]
    red, blue = min(around, key=lambda place: at(*place))
    if at(red, blue) >= _MISSING:
        raise BadInput("no gains show a glove in these pictures: is the hand in view?")
    return Gains(float(_SEARCHED[red]), 1.0, float(_SEARCHED[blue])), at(red, blue), distance(Gains())
