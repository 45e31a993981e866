"""The printed colour card in a picture: what this printer's ten colours are in this camera's eyes and light.

The page's outline is the largest bright area with four corners, or its corners are given; which of them is
the upper left one, the colours themselves tell. A field's colour is the median of its middle, in linear light
as a share of the white field's: what is left of it when the light's colour and strength are divided out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from glovecal_models.colour_glove.palette import COLOUR_NAMES, PRINTED_SRGB, encoded_light, linear_light
from glovecal_models.colour_glove.pictures.white_balance import Gains, white_gains
from glovecal_models.colour_glove.sheets.colour_card import card_fields
from glovecal_models.colour_glove.sheets.sheet import Sheet
from glovecal_models.errors import BadInput

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
