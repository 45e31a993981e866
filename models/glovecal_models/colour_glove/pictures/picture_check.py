"""Whether a picture shows what can be tracked: one hand in this glove, whole, in fit light.

Limits were set on drawn photographs (``colour_glove.photograph``) and proved on others:
tests/models/colour_glove/test_picture_check_rates.py.

The glove in a label image, looked up; a sleeve or a thing of one of its colours beside it is left out.

What belongs to the glove cannot go without the picture resembling hands less; without what does not belong to
it, the picture resembles them more. So where a picture is far from every entry of the database, its larger
pieces of one colour are left out one by one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from glovecal_models.colour_glove.crop import Window, glove_window, tiny_image
from glovecal_models.colour_glove.lookup import Neighbours, PoseLookup
from glovecal_models.colour_glove.pattern import COLOURS, PATCHES
from glovecal_models.errors import BadInput

STRANGE_PX2 = 8.0
"""Image distance: hands in photographs are nearer to one of 20,000 entries in nine of ten frames."""
MUCH_NEARER = 0.6
"""Of the distance with the piece. Leaving out a patch of the glove made it 1.3 times and more."""
LEAST_PIECE = 0.12
"""Of all pixels with a colour: a smaller sleeve moves the window little."""
KINDS = ("over-exposed", "under-exposed", "no hand", "two hands", "cut off", "another glove")
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
MOST_EXTRA_AREAS = 2
"""Areas of one colour beyond the patches of one hand; a finger before a patch cuts it in two."""
MOST_ON_EDGE = 1 / 80
"""Of the picture's width: pixels of the glove that lie on its edge."""
SURPLUS_PX2 = 6.0
"""By how much a hand in this glove may be farther from the database than its entries are from each other."""
_CLIPPED_LEVEL = 254
_BRIGHT_PERCENT = 95
_JOINED, _FILLED = 0.06, 0.2
"""Of a window's half side: gaps that belong to one hand, and holes of a glove that is partly not labelled."""
_LEAST_COLOURS = 3
_OF_AREA, _OF_GLOVE = 0.02, 0.008
"""Least share of an area that a colour has, and of the glove that a patch has, to be counted."""
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
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8:
            raise BadInput(f"a picture is (H, W, 3) uint8, not {picture.shape} {picture.dtype}")
        if labels.shape != picture.shape[:2] or labels.dtype != np.uint8:
            raise BadInput(f"labels {labels.shape} {labels.dtype} of a picture {picture.shape}")
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
        if seen is not None:
            labels = seen.labels
        found = (_second_hand(labels) or _hands_that_touch(labels), _cut_off(labels))
        said = tuple(finding for finding in found if finding is not None)
        return said or (() if seen is None else self._of_pattern(seen))

    def _of_pattern(self, seen: Sighting) -> tuple[Finding, ...]:
        distance = seen.distance_px2
        if distance <= self.distance_limit_px2:
            return ()
        return (
            Finding(
                "another glove", distance, self.distance_limit_px2,
                f"No pose of this glove looks like this: image distance {distance:.1f} squared pixels "
                f"(limit {self.distance_limit_px2:.1f}). Possible causes: another glove, or the other hand; "
                "a sleeve or a thing in one of the glove's colours beside it; a colour cast; fingers that "
                "point down.",
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
    least, extra = _OF_GLOVE * np.count_nonzero(labels), 0
    for colour in range(1, int(labels.max()) + 1):
        own = cv2.morphologyEx((labels == colour).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        _, _, stats, _ = cv2.connectedComponentsWithStats(own, connectivity=8)
        areas = np.count_nonzero(stats[1:, cv2.CC_STAT_AREA] > least)
        extra += max(0, int(areas) - PATCHES // COLOURS)
    if extra <= MOST_EXTRA_AREAS:
        return None
    return Finding(
        "two hands", extra, MOST_EXTRA_AREAS,
        f"Two gloves in view: {extra} more areas of colour than one glove has patches (limit "
        f"{MOST_EXTRA_AREAS}). Take one hand out of the picture.",
    )  # fmt: skip
