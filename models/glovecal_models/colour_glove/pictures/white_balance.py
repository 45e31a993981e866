"""The light's colour taken out of a picture: by something white in it, or by what makes the glove plausible.

A camera that was not balanced for its light multiplies red, green and blue by other numbers. A white
reference tells them; without one, those gains of red and blue are searched for with which the glove's tiny
images come near to the database while most of the glove is labelled (ours; relearning the colours from the
tracker's own answers collapses).

The printed colour card in a picture: what this printer's ten colours are in this camera's eyes and light.

The page's outline is the largest bright area with four corners, or its corners are given; which of them is
the upper left one, the colours themselves tell. A field's colour is the median of its middle, in linear light
as a share of the white field's: what is left of it when the light's colour and strength are divided out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from glovecal_models.colour_glove.crop import glove_window, tiny_image
from glovecal_models.colour_glove.lookup import PoseLookup
from glovecal_models.colour_glove.pattern import COLOUR_NAMES, PRINTED_SRGB, encoded_light, linear_light
from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.colour_glove.sheets.calibration_board import card_fields
from glovecal_models.colour_glove.sheets.sheet import Sheet
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
PX_OF_MM = 3.0
_MIDDLE = 0.25
"""Of a field's side: so much along each edge is left out."""
_LEAST_PAGE, _MOST_PAGE = 0.04, 0.97
"""Of the picture's area."""
_LEAST_RIGHT = 8
"""Of ten colours that lie nearest to their own printed one; fewer: this is not the card."""
_LEAST_APART = 24.0
"""Levels of 255 between two colours in the same light; nearer ones are mistaken on a shaded hand."""
_DARKEST = 0.004
"""Least share of the white field's light that is believed of a channel."""


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


@dataclass(frozen=True, eq=False)
class CardColours:
    """What one picture of the card, or several, tell."""

    inks: np.ndarray
    """(10, 3) red, green, blue: linear light of each colour as a share of white paper's, in white light."""
    gains: Gains
    """That take the light's colour out of pictures."""
    corners_px: np.ndarray
    """(4, 2) u, v of the page's corners in the first picture: upper left, and on with the clock."""


def card_colours(
    pictures: Sequence[np.ndarray], paper: str = "a4", corners_px: np.ndarray | None = None
) -> CardColours:
    """From pictures (H, W, 3) uint8 blue, green, red in one light; the median of several.

    ``corners_px`` (4, 2), for a single picture: of the page, starting anywhere, with the clock; without them
    they are searched for. Raises BadInput for a picture in which the card cannot be found or its colours not
    be told apart.
    """
    if not pictures or (corners_px is not None and len(pictures) > 1):
        raise BadInput(
            f"{len(pictures)} pictures of the card: at least one, and only one where corners are given"
        )
    found = [_of_one(picture, paper, corners_px) for picture in pictures]
    inks = np.median([each.inks for each in found], axis=0)
    _require_apart(inks)
    red, blue = (
        float(np.exp(np.mean([np.log(getattr(each.gains, name)) for each in found])))
        for name in ("red", "blue")
    )
    return CardColours(inks, Gains(red, 1.0, blue), found[0].corners_px)


def page_corners(picture: np.ndarray) -> np.ndarray:
    """(4, 2) u, v of the largest bright area with four corners. Raises BadInput where there is none."""
    darkest = cv2.GaussianBlur(picture.min(axis=2), (5, 5), 0)
    _, bright = cv2.threshold(darkest, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    contours, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = cv2.convexHull(max(contours, key=cv2.contourArea)) if contours else np.zeros((0, 1, 2), np.int32)
    area = float(cv2.contourArea(hull)) if len(hull) else 0.0
    if _LEAST_PAGE * darkest.size <= area <= _MOST_PAGE * darkest.size:
        for share in np.linspace(0.01, 0.08, 15):
            corners = cv2.approxPolyDP(hull, share * cv2.arcLength(hull, True), True)
            if len(corners) == 4 and cv2.contourArea(corners) > 0.9 * area:
                return _with_the_clock(corners[:, 0].astype(float))
    raise BadInput(
        "the card's page is not found: lay it on something darker, all four corners in the picture; or give "
        "the corners"
    )


def _of_one(picture: np.ndarray, paper: str, corners_px: np.ndarray | None) -> CardColours:
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8:
        raise BadInput(f"a picture is (H, W, 3) uint8, not {picture.shape} {picture.dtype}")
    corners = page_corners(picture) if corners_px is None else np.asarray(corners_px, dtype=float)
    if corners.shape != (4, 2) or not np.isfinite(corners).all():
        raise BadInput(f"corners have shape {corners.shape}; four pairs of pixels u, v are expected")
    sheet = Sheet(paper, "")
    turned = [np.roll(corners, -turn, axis=0) for turn in range(4)]
    seen = [_fields(picture, sheet, each) for each in turned]
    right = [_right(inks) for inks, _ in seen]
    best = int(np.argmax(right))
    if right[best] < _LEAST_RIGHT:
        raise BadInput(
            f"this does not look like the colour card: {right[best]} of {len(COLOUR_NAMES)} fields have "
            f"their colour, at least {_LEAST_RIGHT} are expected; are these its corners, on {paper} paper?"
        )
    inks, white = seen[best]
    return CardColours(inks, white_gains(white, np.ones(white.shape[:2], dtype=bool)), turned[best])


def _fields(picture: np.ndarray, sheet: Sheet, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(10, 3) shares of the white field's light, red, green, blue; pixels of the white field's middle."""
    width, height = sheet.width_mm * PX_OF_MM, sheet.height_mm * PX_OF_MM
    page = np.array([(0, 0), (width, 0), (width, height), (0, height)], dtype=np.float32)
    flatten = cv2.getPerspectiveTransform(corners.astype(np.float32), page)
    flat = cv2.warpPerspective(picture, flatten, (round(width), round(height)), flags=cv2.INTER_LINEAR)
    middles = []
    for field in card_fields(sheet):
        inset = _MIDDLE * (field.right - field.left)
        left, top, right, bottom = (
            round(PX_OF_MM * value)
            for value in (field.left + inset, field.top + inset, field.right - inset, field.bottom - inset)
        )
        middles.append(flat[top:bottom, left:right])
    light = [linear_light(np.median(middle.reshape(-1, 3), axis=0))[::-1] for middle in middles]
    white = np.maximum(light[len(COLOUR_NAMES)], 1e-3)
    return np.clip(np.array(light[: len(COLOUR_NAMES)]) / white, _DARKEST, 1.0), middles[len(COLOUR_NAMES)]


def _right(inks: np.ndarray) -> int:
    """How many fields are nearer to their own printed colour than to the nine others."""
    apart = np.linalg.norm(_levels(inks)[:, None] - PRINTED_SRGB[None].astype(float), axis=2)
    return int((apart.argmin(axis=1) == np.arange(len(inks))).sum())


def _require_apart(inks: np.ndarray) -> None:
    apart = np.linalg.norm(_levels(inks)[:, None] - _levels(inks)[None], axis=2) + 1e3 * np.eye(len(inks))
    one, other = sorted(np.unravel_index(int(apart.argmin()), apart.shape))
    if apart[one, other] < _LEAST_APART:
        raise BadInput(
            f"fields {one + 1} ({COLOUR_NAMES[one]}) and {other + 1} ({COLOUR_NAMES[other]}) look alike: "
            f"{apart[one, other]:.0f} levels of 255 apart, at least {_LEAST_APART:.0f} are needed; print on "
            "other paper or change the light"
        )


def _levels(inks: np.ndarray) -> np.ndarray:
    return encoded_light(inks).astype(float)


def _with_the_clock(corners: np.ndarray) -> np.ndarray:
    away = corners - corners.mean(axis=0)
    return corners[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
