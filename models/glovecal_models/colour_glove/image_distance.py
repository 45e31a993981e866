"""How much two tiny images differ: each glove pixel looks for its colour in the other image.

Wang & Popovic 2009, section 4.4: the squared distance from each pixel of the glove to the nearest pixel of
the same colour in the other image, averaged over the pixels; and the mean of both directions. The scan of the
paper lacks the formula; a colour that the other image does not show costs ``CAP``, which is ours, and so does
a pixel farther away.
"""

from __future__ import annotations

import numba
import numpy as np

from glovecal_models.colour_glove.crop import SIZE
from glovecal_models.errors import BadInput

CAP = 144
"""Squared pixels; fits into a byte."""
_REACH_PX = 12
COLOURS = 10


def distance_transform(tiny: np.ndarray, colours: int = COLOURS) -> np.ndarray:
    """(C, 40, 40) uint8: squared distance from each place to the nearest pixel of each colour, at most CAP.

    Raises BadInput for another kind of image.
    """
    if tiny.shape != (SIZE, SIZE) or tiny.dtype != np.uint8 or tiny.max() > colours:
        raise BadInput(
            f"a tiny image is ({SIZE}, {SIZE}) uint8 up to {colours}; not {tiny.shape} {tiny.dtype}"
        )
    found = np.empty((colours, SIZE, SIZE), dtype=np.uint8)
    transform_into(tiny, found)
    return found


def image_distance(first: np.ndarray, second: np.ndarray) -> float:
    """Of two tiny images, in squared pixels; symmetric. Without any glove pixel in one: CAP."""
    colours = max(COLOURS, int(first.max()), int(second.max()))
    theirs = distance_transform(second, colours)[None]
    mine = distance_transform(first, colours)
    return float(distances(first, mine, second[None], theirs, np.zeros(1, dtype=np.int64))[0])


@numba.njit(cache=True)
def transform_into(tiny, found):  # type: ignore[no-untyped-def]
    """Kernel of ``distance_transform``: along columns, then along rows."""
    size = len(tiny)
    along = np.empty((size, size), dtype=np.int32)
    tops, heights, begins = np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size)
    shown = np.zeros(256, dtype=np.bool_)
    for y in range(size):
        for x in range(size):
            shown[tiny[y, x]] = True
    for index in range(len(found)):
        if not shown[index + 1]:
            found[index] = CAP
            continue
        for x in range(size):
            far = _REACH_PX + 1
            for y in range(size):
                far = 0 if tiny[y, x] == index + 1 else min(far + 1, _REACH_PX + 1)
                along[y, x] = far
            far = _REACH_PX + 1
            for y in range(size - 1, -1, -1):
                far = 0 if tiny[y, x] == index + 1 else min(far + 1, _REACH_PX + 1)
                along[y, x] = min(along[y, x], far)
        for y in range(size):
            # The row's distances are the lower envelope of parabolas, one on each column that has the colour
            # near (Felzenszwalb & Huttenlocher 2012, "Distance transforms of sampled functions").
            last = -1
            for x in range(size):
                if along[y, x] > _REACH_PX:
                    continue
                height = along[y, x] ** 2 + x * x
                while last >= 0:
                    meet = (height - heights[last]) / (2.0 * (x - tops[last]))
                    if meet > begins[last]:
                        break
                    last -= 1
                begins[last + 1] = (height - heights[last]) / (2.0 * (x - tops[last])) if last >= 0 else -1.0
                last += 1
                tops[last], heights[last] = x, height
            if last < 0:
                found[index, y] = CAP
                continue
            part = 0
            for x in range(size):
                while part < last and begins[part + 1] <= x:
                    part += 1
                found[index, y, x] = min(CAP, x * x - 2 * x * tops[part] + heights[part])


@numba.njit(cache=True)
def distances(tiny, transform, entries, transforms, chosen):  # type: ignore[no-untyped-def]
    """Kernel: of one image (40, 40) and its transform (C, 40, 40) to the ``chosen`` (K,) of N entries."""
    size = len(tiny)
    found = np.empty(len(chosen))
    places = np.empty((size * size, 3), dtype=np.int64)
    mine = 0
    for y in range(size):
        for x in range(size):
            if tiny[y, x]:
                places[mine] = (tiny[y, x] - 1, y, x)
                mine += 1
    for place in range(len(chosen)):
        entry = chosen[place]
        there, total = transforms[entry], 0
        for pixel in range(mine):
            total += there[places[pixel, 0], places[pixel, 1], places[pixel, 2]]
        here, count, image = 0, 0, entries[entry]
        for y in range(size):
            for x in range(size):
                label = image[y, x]
                if label:
                    here += transform[label - 1, y, x]
                    count += 1
        if mine and count:
            found[place] = 0.5 * (total / mine + here / count)
        else:
            found[place] = CAP
    return found
