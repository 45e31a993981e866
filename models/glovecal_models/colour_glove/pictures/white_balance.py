"""The light's colour taken out of a picture: by something white in it, or by what makes the glove plausible.

A camera that was not balanced for its light multiplies red, green and blue by other numbers. A white
reference tells them; without one, those gains of red and blue are searched for with which the glove's tiny
images come near to the database while most of the glove is labelled (ours; relearning the colours from the
tracker's own answers collapses).
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
_COARSE = np.linspace(-0.6, 0.6, 5)
_STEPS = (0.15, 0.15, 0.075, 0.075)
"""Logarithms of the gains searched through, and how they are refined."""
_PIXELS_WEIGH = 3.0
"""Of the logarithm of the glove's pixels, against that of the distance. By the distance alone gains win that
lose pixels on patches' edges: a thinner glove looks the same."""
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
    """Gains of red and blue with which a few pictures show much glove, near to the database.

    Returns them, and the mean image distance (squared pixels) with and without. Raises BadInput for no
    picture, and when no gains show a glove.
    """
    if not pictures:
        raise BadInput("gains are searched for in at least one picture; none was given")

    def seen(gains: Gains) -> tuple[float, float]:
        """Score, the less the better, and mean image distance."""
        scores, found = [], []
        for picture in pictures:
            labels = table.labels(gains.corrected(picture))
            window = glove_window(labels)
            tiny = None if window is None else tiny_image(labels, window)
            if tiny is None or np.count_nonzero(tiny) <= 0.1 * tiny.size:
                distance, pixels = _MISSING, 1
            else:
                distance = float(lookup.neighbours(tiny, 1).distances[0])
                pixels = np.count_nonzero(labels)
            found.append(distance)
            scores.append(np.log(distance + 1.0) - _PIXELS_WEIGH * np.log(pixels))
        return float(np.mean(scores)), float(np.mean(found))

    tried: dict[tuple[float, float], tuple[float, float]] = {}

    def best_of(places: list[tuple[float, float]]) -> tuple[float, float]:
        for red, blue in places:
            place = (round(red, 4), round(blue, 4))
            if place not in tried:
                tried[place] = seen(_gains(place))
        return min(tried, key=lambda place: tried[place][0])

    best = best_of([(red, blue) for red in _COARSE for blue in _COARSE])
    for step in _STEPS:
        around = (-step, 0.0, step)
        best = best_of([(best[0] + red, best[1] + blue) for red in around for blue in around])
    if tried[best][1] >= _MISSING:
        raise BadInput("no gains show a glove in these pictures: is the hand in view?")
    return _gains(best), tried[best][1], seen(Gains())[1]


def _gains(place: tuple[float, float]) -> Gains:
    return Gains(float(np.exp(place[0])), 1.0, float(np.exp(place[1])))
