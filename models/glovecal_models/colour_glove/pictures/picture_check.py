"""Whether a picture shows what can be tracked: one hand in this glove, whole, in fit light.

Limits were set on drawn photographs, also with cast shadows and gloss; how often they are wrong on others
tests/models/colour_glove/test_picture_check_rates.py counts. Pictures are taken at the working size.

The glove in a label image, looked up; a sleeve or a thing of one of its colours beside it is left out.

What belongs to the glove cannot go without the picture resembling hands less; without what does not belong to
it, the picture resembles them more. So where a picture is far from every entry of the database, its larger
pieces of one colour are left out one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from glovecal_models.colour_glove.crop import Window, glove_window, tiny_image
from glovecal_models.colour_glove.lookup import Neighbours, PoseLookup
from glovecal_models.colour_glove.pattern import COLOURS, PATCHES, PRINTED_SRGB, linear_light
from glovecal_models.errors import BadInput

STRANGE_PX2 = 8.0
"""Image distance: hands in photographs are nearer to one of 20,000 entries in nine of ten frames."""
MUCH_NEARER = 0.6
"""Of the distance with the piece. Leaving out a patch of the glove made it 1.3 times and more."""
LEAST_PIECE = 0.12
"""Of all pixels with a colour: a smaller sleeve moves the window little."""
KINDS = ("over-exposed", "under-exposed", "no hand", "two hands", "cut off", "mirrored", "another glove")
LEAST_GLOVE = 0.002
"""Share of a picture: a hand of fewer pixels is too small to tell its pose."""
MOST_CLIPPED = 0.22
"""Share of the glove with a channel at its highest level; beyond it one pixel in four or more is mistaken."""
MOST_CLIPPED_OF_PICTURE = 0.12
"""The same where no glove is seen; a white wall or a window is less, or the glove is seen before it."""
LEAST_BRIGHT, LEAST_BRIGHT_OF_PICTURE = 150.0, 115.0
"""Level of 255 that the brightest twentieth of the glove, or of a picture without one, reaches."""
MOST_SECOND = 0.3
"""Second area of many colours, over the first: a hand seen in two pieces has a smaller one."""
MOST_EXTRA_AREAS = 1
"""Areas of one colour beyond the patches of one hand; a finger before a patch cuts it in two."""
ONE_HAND = 0.75
"""Of the limit of ``another glove``: what is nearer than that is one hand, whatever its areas are."""
MIRROR_NEARER, MIRROR_AS_FAR = 0.75, 1.5
"""Distance of the mirror image over the picture's own. A picture of this glove is far nearer than its mirror
image (1.6 times in 99 of 100), one that was mirrored far farther, and another glove is as far either way."""
MOST_ON_EDGE = 1 / 80
"""Of the picture's width: pixels of the glove that lie on its edge."""
SURPLUS_PX2 = 6.0
"""By how much a hand in this glove may be farther from the database than its entries are from each other."""
SHADOWED = 0.35
"""Of the light on the best lit tenth of the glove: cloth with less is in shadow."""
MOST_SHADOWED = 0.25
"""Of the glove, over many pictures: rooms with light from all sides have 0.08, with two lamps alone 0.32, and
half as many colours again are mistaken there (tests/simulated/lit_glove.py, seeds 500 to 507)."""
_FEWEST_LIT = 10
_CLIPPED_LEVEL = 254
_BRIGHT_PERCENT = 95
_JOINED, _FILLED = 0.06, 0.2
"""Of a window's half side: gaps that belong to one hand, and holes of a glove that is partly not labelled."""
_LEAST_COLOURS = 3
_OF_AREA, _OF_GLOVE = 0.02, 0.008
"""Least share of an area that a colour has, and of the glove that a patch has, to be counted."""
_PATCH_GRID, _PATCH_JOINED = 96, 2
"""Cells along the glove's longer side in which patches are counted, and how far pieces of one patch, which a
shadow or a shine divides, may lie apart."""
_ASKED_ENTRIES, _OF_ENTRIES_PERCENT = 200, 95


@dataclass(frozen=True, eq=False)
class Sighting:
    labels: np.ndarray
    """(H, W) uint8, without what is no glove."""
    window: Window
    neighbours: Neighbours

    @classmethod
    def of(cls, labels: np.ndarray, lookup: PoseLookup) -> Sighting | None:
        """None where there is no glove. Raises BadInput for another kind of array."""
        found = _looked_up(labels, lookup, (0, 1, 2, 3))
        if found is None or found.distance_px2 <= STRANGE_PX2:
            return found
        best, least = found, MUCH_NEARER * found.distance_px2
        turns = sorted({0, found.neighbours.quarter_turns})
        for without in _without_each_large_piece(labels):
            other = _looked_up(without, lookup, turns)
            if other is not None and other.distance_px2 < least:
                best, least = other, other.distance_px2
        return best

    @property
    def distance_px2(self) -> float:
        """Image distance to the nearest entry, squared pixels of the tiny image."""
        return float(self.neighbours.distances[0])


def _looked_up(labels: np.ndarray, lookup: PoseLookup, turns: Sequence[int]) -> Sighting | None:
    window = glove_window(labels)
    tiny = None if window is None else tiny_image(labels, window)
    if window is None or tiny is None or not tiny.any():
        return None
    return Sighting(labels, window, lookup.neighbours_of_any_turn(tiny, STRANGE_PX2, turns))


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


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a picture."""

    kind: str
    """One of ``KINDS``."""
    value: float
    limit: float
    sentence: str
    """What is wrong, with value and limit, and what to do."""


@dataclass(frozen=True, eq=False)
class PictureCheck:
    """``lookup`` None: whether it is another glove is not told. A check takes as long as a look-up and more:
    a few pictures a second are enough."""

    lookup: PoseLookup | None = None

    def findings(self, picture: np.ndarray, labels: np.ndarray) -> tuple[Finding, ...]:
        """What is wrong with a picture (H, W, 3) uint8 whose colours were read as ``labels`` (H, W) uint8.

        Causes hide what follows from them: of a picture too bright for its colours nothing else is said.
        Empty where all is well. Raises BadInput for arrays that do not fit.
        """
        _require_alike(picture, labels)
        least = int(np.ceil(LEAST_GLOVE * labels.size))
        count = int(np.count_nonzero(labels))
        exposure = _exposure(picture, labels, seen=count >= least)
        if exposure is not None:
            return (exposure,)
        if count < least:
            return (
                Finding(
                    "no hand", count, least,
                    f"No glove in view: {count} pixels of its colours, at least {least} expected. Hold the "
                    "gloved hand before the camera, not too far away; if it is there, make a colour table.",
                ),
            )  # fmt: skip
        seen = None if self.lookup is None else Sighting.of(labels, self.lookup)
        is_one_hand = False
        if seen is not None:
            labels = seen.labels
            is_one_hand = seen.distance_px2 <= ONE_HAND * self.distance_limit_px2
        second = _second_hand(labels) or (None if is_one_hand else _hands_that_touch(labels))
        found = (second, _cut_off(labels))
        said = tuple(finding for finding in found if finding is not None)
        return said or (() if seen is None else self._of_pattern(seen))

    def _of_pattern(self, seen: Sighting) -> tuple[Finding, ...]:
        distance, limit = seen.distance_px2, self.distance_limit_px2
        if self.lookup is None or distance <= ONE_HAND * limit:
            return ()
        tiny = tiny_image(seen.labels, seen.window)
        mirrored = float(self.lookup.neighbours_of_any_turn(tiny[:, ::-1]).distances[0])
        if mirrored <= min(limit, MIRROR_NEARER * distance):
            return (
                Finding(
                    "mirrored", mirrored, MIRROR_NEARER * distance,
                    f"The picture is mirrored, or this is the glove of the other hand: its mirror image "
                    f"resembles this glove (image distance {mirrored:.1f} squared pixels instead of "
                    f"{distance:.1f}). Webcams and phones often mirror their preview: switch that off in the "
                    "camera's settings, or say that the pictures are mirrored (--mirrored). For the glove of "
                    "the other hand choose that hand (--hand).",
                ),
            )  # fmt: skip
        if distance <= limit or mirrored > MIRROR_AS_FAR * distance:
            return ()
        return (
            Finding(
                "another glove", distance, limit,
                f"No pose of this glove looks like this: image distance {distance:.1f} squared pixels "
                f"(limit {limit:.1f}). Possible causes: another glove; a sleeve or a thing in one of the "
                "glove's colours beside it; a colour cast; fingers that point at the camera.",
            ),
        )  # fmt: skip

    @cached_property
    def distance_limit_px2(self) -> float:
        """Image distance above which no pose of the database is meant, squared pixels.

        Hands between the entries of a small database are farther away from them, so it follows the distances
        of entries from their own neighbours; infinite without a look-up.
        """
        if self.lookup is None:
            return float("inf")
        images = self.lookup.database.tiny
        chosen = np.unique(np.linspace(0, len(images) - 1, _ASKED_ENTRIES).astype(int))
        nearest = []
        for entry in chosen:
            found = self.lookup.neighbours(np.array(images[entry]), 2)
            nearest.extend(found.distances[found.entries != entry][:1])
        return SURPLUS_PX2 + (float(np.percentile(nearest, _OF_ENTRIES_PERCENT)) if nearest else 0.0)


def shadowed(picture: np.ndarray, labels: np.ndarray) -> float | None:
    """Share of the glove that is in shadow, 0 to 1; None where no glove is seen.

    The light on the cloth is what a pixel sends back over what its printed colour does (linear light, in the
    channel that this colour sends back most of). Raises BadInput for arrays that do not fit.
    """
    _require_alike(picture, labels)
    glove = labels[::2, ::2] > 0
    if not glove.any():
        return None
    inks = linear_light(PRINTED_SRGB[:, ::-1])[labels[::2, ::2][glove].astype(int) - 1]
    strongest = inks.argmax(axis=1)
    pixels = np.arange(len(inks))
    light = linear_light(picture[::2, ::2][glove])[pixels, strongest] / inks[pixels, strongest]
    return float(np.mean(light < SHADOWED * np.percentile(light, 90)))


def light_advice(shares: Sequence[float]) -> str:
    """What to change of the light, by what ``shadowed`` said of many pictures; empty where it will do."""
    if len(shares) < _FEWEST_LIT or (mean := float(np.mean(shares))) <= MOST_SHADOWED:
        return ""
    return (
        f"{mean:.0%} of the glove is in shadow on average (up to {MOST_SHADOWED:.0%} does no harm): colours "
        "are mistaken there. Light it from all sides, by a second lamp or against a white wall."
    )


def _require_alike(picture: np.ndarray, labels: np.ndarray) -> None:
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8:
        raise BadInput(f"a picture is (H, W, 3) uint8, not {picture.shape} {picture.dtype}")
    if labels.shape != picture.shape[:2] or labels.dtype != np.uint8:
        raise BadInput(f"labels {labels.shape} {labels.dtype} of a picture {picture.shape}")


def _exposure(picture: np.ndarray, labels: np.ndarray, *, seen: bool) -> Finding | None:
    """Where a glove is seen only it counts: the room behind it may be dark or bright."""
    highest = np.maximum(np.maximum(picture[..., 0], picture[..., 1]), picture[..., 2])[::2, ::2]
    area = _filled(labels[::2, ::2])
    seen = seen and bool(area.any())
    what, levels = ("glove", highest[area]) if seen else ("picture", highest.ravel())
    clipped = float(np.count_nonzero(levels >= _CLIPPED_LEVEL) / levels.size)
    most = MOST_CLIPPED if seen else MOST_CLIPPED_OF_PICTURE
    if clipped > most:
        return Finding(
            "over-exposed", clipped, most,
            f"Over-exposed: {clipped:.0%} of the {what} is at the highest level (limit {most:.0%}). Shorten "
            "the exposure, or dim the light.",
        )  # fmt: skip
    counted = np.cumsum(np.bincount(levels, minlength=256))
    bright = float(np.searchsorted(counted, _BRIGHT_PERCENT / 100 * counted[-1]))
    least = LEAST_BRIGHT if seen else LEAST_BRIGHT_OF_PICTURE
    if bright < least:
        return Finding(
            "under-exposed", bright, least,
            f"Under-exposed: 95 % of the {what} is darker than level {bright:.0f} of 255 (limit "
            f"{least:.0f}). Add light, or lengthen the exposure.",
        )  # fmt: skip
    return None


def _filled(labels: np.ndarray) -> np.ndarray:
    """The glove and the holes in it, (H, W) bool: a pixel at the highest level often has no label."""
    reach = _reach(labels, _FILLED)
    glove = np.pad((labels > 0).astype(np.uint8), reach)
    closed = cv2.morphologyEx(glove, cv2.MORPH_CLOSE, np.ones((2 * reach + 1,) * 2, np.uint8))
    return closed[reach:-reach, reach:-reach].astype(bool)


def _reach(labels: np.ndarray, share: float) -> int:
    window = glove_window(labels)
    return max(1, round(share * window.half)) if window is not None else 1


def _second_hand(labels: np.ndarray) -> Finding | None:
    reach = _reach(labels, _JOINED)
    joined = cv2.dilate((labels > 0).astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8))
    count, areas = cv2.connectedComponents(joined, connectivity=8, ltype=cv2.CV_32S)
    glove = labels > 0
    by_colour = np.bincount(areas[glove] * 256 + labels[glove], minlength=count * 256).reshape(count, 256)[1:]
    sizes = by_colour.sum(axis=1)
    has = (by_colour > np.maximum(10, _OF_AREA * sizes)[:, None]).sum(axis=1)
    sizes = np.sort(sizes[has >= _LEAST_COLOURS])[::-1]
    if len(sizes) < 2 or sizes[1] <= MOST_SECOND * sizes[0]:
        return None
    share = float(sizes[1] / sizes[0])
    return Finding(
        "two hands", share, MOST_SECOND,
        f"Two gloves in view: the second is {share:.0%} as large as the first (limit {MOST_SECOND:.0%}). "
        "Take one hand out of the picture.",
    )  # fmt: skip


def _cut_off(labels: np.ndarray) -> Finding | None:
    rim = (labels[0], labels[-1], labels[1:-1, 0], labels[1:-1, -1])
    count, most = sum(int(np.count_nonzero(line)) for line in rim), MOST_ON_EDGE * labels.shape[1]
    if count <= most:
        return None
    return Finding(
        "cut off", count, most,
        f"The hand is cut off: {count} pixels of the glove lie on the picture's edge (limit {most:.0f}). "
        "Move it to the middle, or farther away.",
    )  # fmt: skip


def _hands_that_touch(labels: np.ndarray) -> Finding | None:
    """Areas of one colour beyond those that one glove has, summed over the colours."""
    u, v, width, height = cv2.boundingRect((labels > 0).astype(np.uint8))
    labels = labels[v : v + height, u : u + width]
    share = _PATCH_GRID / max(width, height, 1)
    size = max(1, round(width * share)), max(1, round(height * share))
    least, extra = _OF_GLOVE * share**2 * np.count_nonzero(labels), 0
    for colour in range(1, int(labels.max()) + 1):
        own = cv2.resize((labels == colour).astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.5
        own = cv2.morphologyEx(own.astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
        joined = cv2.dilate(own, np.ones((2 * _PATCH_JOINED + 1,) * 2, np.uint8))
        count, areas = cv2.connectedComponents(joined, connectivity=8, ltype=cv2.CV_32S)
        sizes = np.bincount(areas[own > 0], minlength=count)[1:]
        extra += max(0, int((sizes > least).sum()) - PATCHES // COLOURS)
    if extra <= MOST_EXTRA_AREAS:
        return None
    return Finding(
        "two hands", extra, MOST_EXTRA_AREAS,
        f"Two gloves in view: {extra} more areas of colour than one glove has patches (limit "
        f"{MOST_EXTRA_AREAS}). Take one hand out of the picture.",
    )  # fmt: skip
