"""A representative set of samples: takes are long and neighbours in time are alike.

The space of inputs and target is cut into cells; samples are drawn cell by cell and take by take in turn,
so that a pose held for a minute weighs no more than one passed in a second, and no take is left out.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.samples import Samples

DEFAULT_SAMPLES = 2000


def representative_index(samples: Samples, count: int = DEFAULT_SAMPLES, *, seed: int = 0) -> np.ndarray:
    """Indices of at most ``count`` samples, increasing; all of them when there are no more."""
    if len(samples) <= count:
        return np.arange(len(samples))
    cells = _cells(samples, count)
    order = np.random.default_rng(seed).permutation(len(samples))
    turn = _turn_within(cells[order])
    first = order[np.argsort(turn, kind="stable")][:count]
    return np.sort(first)


def _cells(samples: Samples, count: int) -> np.ndarray:
    """A cell number for each sample, with the finest grid that has at most ``count`` occupied cells."""
    space = np.column_stack([samples.inputs, samples.target])
    low, high = space.min(axis=0), space.max(axis=0)
    unit = (space - low) / np.where(high > low, high - low, 1.0)
    cells = samples.take
    for divisions in (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 128):
        finer = _numbered(samples.take, np.floor(unit * divisions * (1 - 1e-12)), divisions)
        if finer.max() >= count:
            break
        cells = finer
    return cells


def _numbered(take: np.ndarray, grid: np.ndarray, divisions: int) -> np.ndarray:
    """A number for each row of (take, grid), in their order; by one integer key where it has room."""
    columns = grid.astype(np.int64)
    if (int(take.max()) + 1) * float(divisions) ** columns.shape[1] > 2**62:
        return np.unique(np.column_stack([take, columns]), axis=0, return_inverse=True)[1].ravel()
    key = take.astype(np.int64)
    for column in columns.T:
        key = key * divisions + column
    return np.unique(key, return_inverse=True)[1].ravel()


def _turn_within(cells: np.ndarray) -> np.ndarray:
    """For each sample, how many samples of its cell come before it."""
    by_cell = np.argsort(cells, kind="stable")
    sorted_cells = cells[by_cell]
    starts = np.flatnonzero(np.r_[True, sorted_cells[1:] != sorted_cells[:-1]])
    lengths = np.diff(np.r_[starts, len(cells)])
    turn = np.empty(len(cells), dtype=int)
    turn[by_cell] = np.arange(len(cells)) - np.repeat(starts, lengths)
    return turn
