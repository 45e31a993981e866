"""A clock whose offset changes within takes: for each block of time the offset that the other joints want.

A clock is off for all joints alike. So the path of one joint's offset through the blocks of a take is the
likeliest one of all other joints together (Viterbi 1967), where a change of the offset costs in proportion to
its size; what it leaves of this joint's error was not fitted to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.delay.delay_grid import DelayErrors

FEWEST_JOINTS = 3
ROWS_ALIKE = 8
"""Neighbouring rows of smoothed signals say nearly the same."""
NATS_A_SECOND = 200.0
"""Of the log likelihood, for a change of the offset by a second: two for 10 ms."""


def cells_of_others(grids: Sequence[DelayErrors]) -> list[np.ndarray] | None:
    """For each joint (B,) the cell among those of a mere delay in each block; None where joints have other
    blocks than each other, or are too few."""
    takes = grids[0].take
    if len(grids) < FEWEST_JOINTS or any(not np.array_equal(grid.take, takes) for grid in grids):
        return None
    cost = np.array([_nats(grid) for grid in grids])
    every = cost.sum(axis=0)
    delay_s = grids[0].delay_s[grids[0].clock]
    change = NATS_A_SECOND * np.abs(delay_s[:, None] - delay_s[None, :])
    return [_likeliest(every - own, takes, change) for own in cost]


def _nats(grid: DelayErrors) -> np.ndarray:
    """(B, K): what each cell costs in each block."""
    blocks = grid.blocks[:, grid.clock]
    least = blocks.min(axis=1).sum()
    rows = max(grid.rows, 1)
    return blocks * (0.5 * rows / ROWS_ALIKE / max(float(least), 1e-12))


def _likeliest(cost: np.ndarray, takes: np.ndarray, change: np.ndarray) -> np.ndarray:
    """(B,) of the cheapest path through ``cost`` (B, K), anew in each take."""
    found = np.empty(len(cost), dtype=int)
    for take in np.unique(takes):
        rows = np.flatnonzero(takes == take)
        so_far, came_from = cost[rows[0]], []
        for row in rows[1:]:
            step = so_far[:, None] + change
            came_from.append(step.argmin(axis=0))
            so_far = step.min(axis=0) + cost[row]
        cell = int(so_far.argmin())
        found[rows[-1]] = cell
        for row, before in zip(rows[-2::-1], came_from[::-1], strict=True):
            cell = int(before[cell])
            found[row] = cell
    return found
