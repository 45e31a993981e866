"""Where the glove is in a label image, and the tiny image of it: 40 x 40 labels, whatever size it had.

Mean shift with a uniform kernel whose bandwidth follows the spread of the glove's pixels inside it (Wang &
Popovic 2009, section 4.3); then a majority vote. Photographs and rendered entries pass through the same code.
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

    def from_tiny(self, points: np.ndarray) -> np.ndarray:
        """The inverse of ``to_tiny``."""
        low = np.array([self.u, self.v]) - self.half
        return (np.asarray(points, dtype=float) + 0.5) * (2 * self.half / SIZE) + low


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
