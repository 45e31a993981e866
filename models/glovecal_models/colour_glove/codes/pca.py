"""A code of 32 numbers: principal components of the pooled distance transforms.

Not in Wang & Popovic 2009: a plain alternative to their boosted bits, quicker to learn and closer to the
image distance (``do.py paper --part colour-glove`` compares them).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from glovecal_models.colour_glove.crop import SIZE
from glovecal_models.errors import BadInput

DIMENSIONS = 32
_CELL = 4
_MOST_LEARNED_ON = 5000


@dataclass(frozen=True, eq=False)
class PcaCode:
    """N codes of D numbers."""

    mean: np.ndarray
    axes: np.ndarray
    """(F, D)."""
    codes: np.ndarray
    """(N, D) float32."""

    def nearest(self, transform: np.ndarray, count: int) -> np.ndarray:
        """The ``count`` entries whose codes are nearest to that of a distance transform, nearest first."""
        query = ((_pooled(transform[None]) - self.mean) @ self.axes)[0].astype(np.float32)
        apart = _squares(self.codes, query)
        return smallest(apart, count)


def pca_code(transforms: np.ndarray, dimensions: int = DIMENSIONS) -> PcaCode:
    """Learn from at most 5,000 of the entries' distance transforms (N, C, 40, 40), and code all.

    Raises BadInput when more dimensions are asked for than entries or features give.
    """
    features = transforms.shape[1] * (SIZE // _CELL) ** 2
    if not 1 <= dimensions <= min(features, len(transforms)):
        raise BadInput(f"{dimensions} dimensions from {len(transforms)} entries of {features} features")
    sample = _pooled(np.ascontiguousarray(transforms[:: -(-len(transforms) // _MOST_LEARNED_ON)]))
    mean = sample.mean(axis=0)
    _, vectors = np.linalg.eigh((sample - mean).T @ (sample - mean))
    axes = np.ascontiguousarray(vectors[:, ::-1][:, :dimensions])
    codes = np.empty((len(transforms), dimensions), np.float32)
    for low in range(0, len(transforms), 1000):
        codes[low : low + 1000] = (_pooled(np.array(transforms[low : low + 1000])) - mean) @ axes
    return PcaCode(mean, axes, codes)


def smallest(values: np.ndarray, count: int) -> np.ndarray:
    """Indices of the ``count`` smallest, ascending; of equal ones the first."""
    count = min(count, len(values))
    bound = np.partition(values, count - 1)[count - 1]
    candidates = np.flatnonzero(values <= bound)
    return candidates[np.argsort(values[candidates], kind="stable")][:count]


@numba.njit(cache=True)
def _squares(codes, query):  # type: ignore[no-untyped-def]
    found = np.empty(len(codes), dtype=np.float32)
    for entry in range(len(codes)):
        total = np.float32(0.0)
        for dimension in range(len(query)):
            difference = codes[entry, dimension] - query[dimension]
            total += difference * difference
        found[entry] = total
    return found


@numba.njit(cache=True)
def _pooled(transforms):  # type: ignore[no-untyped-def]
    """(N, C * 100): the root of the mean over cells of 4 x 4, in pixels."""
    count, colours, size = transforms.shape[:3]
    across = size // _CELL
    found = np.empty((count, colours * across * across))
    for entry in range(count):
        for colour in range(colours):
            for row in range(across):
                for column in range(across):
                    total = 0
                    for y in range(row * _CELL, (row + 1) * _CELL):
                        for x in range(column * _CELL, (column + 1) * _CELL):
                            total += transforms[entry, colour, y, x]
                    place = (colour * across + row) * across + column
                    found[entry, place] = np.sqrt(total / _CELL**2)
    return found
