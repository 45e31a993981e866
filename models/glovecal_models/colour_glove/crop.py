"""Where the glove is in a label image, and the tiny image of it: 40 x 40 labels, whatever size it had.

Mean shift with a uniform kernel whose bandwidth follows the spread of the glove's pixels inside it (Wang &
Popovic 2009, section 4.3); then a majority vote. Photographs and rendered entries pass through the same code.

How much two tiny images differ: each glove pixel looks for its colour in the other image.

Wang & Popovic 2009, section 4.4: the squared distance from each pixel of the glove to the nearest pixel of
the same colour in the other image, averaged over the pixels; and the mean of both directions. The scan of the
paper lacks the formula; a colour that the other image does not show costs ``CAP``, which is ours, and so does
a pixel farther away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from glovecal_models.errors import BadInput

SIZE = 40
"""Pixels along each side of a tiny image."""
BANDWIDTH_SD = 2.1
"""Half a window's side over the standard deviation of the glove's pixels (both directions together): a flat
hand reaches 1.8 from its mean, a fist 1.4."""
_MOST_SHIFTS = 30
CAP = 144
"""Squared pixels; fits into a byte."""
_REACH_PX = 12
COLOURS = 10


@dataclass(frozen=True)
class Window:
    """A square in a picture, in its pixels; may reach beyond it."""

    u: float
    v: float
    half: float

    def to_tiny(self, points_px: np.ndarray) -> np.ndarray:
        """Points (..., 2) of the picture in the tiny image's pixels."""
        low = np.array([self.u, self.v]) - self.half
        return (np.asarray(points_px, dtype=float) - low) * (SIZE / (2 * self.half)) - 0.5


def glove_window(labels: np.ndarray) -> Window | None:
    """The window around the glove in a label image (H, W) uint8; None where there is no glove.

    Raises BadInput for another kind of array.
    """
    _require_labels(labels)
    u, v, half = shifted_window(labels)
    return Window(u, v, half) if half > 0 else None


def tiny_image(labels: np.ndarray, window: Window) -> np.ndarray:
    """(40, 40) uint8: in each cell of the window the label most of its pixels have; outside the picture 0."""
    _require_labels(labels)
    return voted(labels, window.u, window.v, window.half)


def _require_labels(labels: np.ndarray) -> None:
    if labels.ndim != 2 or labels.dtype != np.uint8:
        raise BadInput(f"a label image is (H, W) uint8, not {labels.shape} {labels.dtype}")


@numba.njit(cache=True)
def shifted_window(labels):  # type: ignore[no-untyped-def]
    """Kernel: centre u, v and half side; half side 0 without a glove."""
    height, width = labels.shape
    u, v = (width - 1) / 2.0, (height - 1) / 2.0
    half = float(max(width, height))
    for _ in range(_MOST_SHIFTS):
        count, sum_u, sum_v, square = 0, 0.0, 0.0, 0.0
        top, bottom = max(0, int(np.ceil(v - half))), min(height - 1, int(np.floor(v + half)))
        left, right = max(0, int(np.ceil(u - half))), min(width - 1, int(np.floor(u + half)))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                if labels[y, x]:
                    count += 1
                    sum_u += x
                    sum_v += y
                    square += x * x + y * y
        if count == 0:
            return u, v, 0.0
        mean_u, mean_v = sum_u / count, sum_v / count
        # A pixel is a square: its own spread keeps the window of a single one from vanishing.
        spread = np.sqrt(max(square / count - mean_u**2 - mean_v**2, 0.0) + 1.0 / 6.0)
        wanted = BANDWIDTH_SD * spread
        change = abs(mean_u - u) + abs(mean_v - v) + abs(wanted - half)
        u, v, half = mean_u, mean_v, wanted
        if change < 0.01 * half:
            break
    return u, v, half


@numba.njit(cache=True)
def voted(labels, u, v, half):  # type: ignore[no-untyped-def]
    """Kernel of ``tiny_image``. A cell between pixel centres takes the nearest pixel; of equal counts the
    smaller label wins."""
    height, width = labels.shape
    tiny = np.zeros((SIZE, SIZE), dtype=np.uint8)
    counts = np.zeros(int(labels.max()) + 1, dtype=np.int64)
    cell = 2.0 * half / SIZE
    for row in range(SIZE):
        low_v = v - half + row * cell
        top, bottom = int(np.ceil(low_v)), int(np.ceil(low_v + cell)) - 1
        if bottom < top:
            top = bottom = int(np.round(low_v + cell / 2))
        for column in range(SIZE):
            low_u = u - half + column * cell
            left, right = int(np.ceil(low_u)), int(np.ceil(low_u + cell)) - 1
            if right < left:
                left = right = int(np.round(low_u + cell / 2))
            counts[:] = 0
            for y in range(top, bottom + 1):
                for x in range(left, right + 1):
                    inside = 0 <= y < height and 0 <= x < width
                    counts[labels[y, x] if inside else 0] += 1
            tiny[row, column] = np.argmax(counts)
    return tiny


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
def _along_columns(tiny, colour, along):  # type: ignore[no-untyped-def]
    """Fills ``along`` (40, 40) with how far the next pixel of ``colour`` is in the same column."""
    size = len(tiny)
    for x in range(size):
        far = _REACH_PX + 1
        for y in range(size):
            far = 0 if tiny[y, x] == colour else min(far + 1, _REACH_PX + 1)
            along[y, x] = far
        far = _REACH_PX + 1
        for y in range(size - 1, -1, -1):
            far = 0 if tiny[y, x] == colour else min(far + 1, _REACH_PX + 1)
            along[y, x] = min(along[y, x], far)


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
        _along_columns(tiny, index + 1, along)
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
