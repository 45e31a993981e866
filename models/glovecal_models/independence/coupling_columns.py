"""Columns of the regression that takes a still sensor's deviation apart, and least squares block by block.

Each neighbour has a curve of its own, a polynomial of u, how far it is from where the take began (in shares
of its range), and two neighbours may have products ``u1 u2``, ``u1**2 u2`` and ``u1 u2**2``. All of them are
zero where the take began: a neighbour's curve is what it does when it moves alone. Sums of products are kept
for each block of time, so that leaving out a block or drawing blocks anew costs one small solution.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

POWERS = (1, 2, 3, 4)
PRODUCTS = ((1, 1), (2, 1), (1, 2))
BLOCK_S = 1.0
"""Neighbouring frames err alike; pieces this long hardly do."""
FOLDS = 5
RIDGE = 1e-8


def curve_columns(share: np.ndarray) -> np.ndarray:
    """Shape (N, len(POWERS)), of one sensor's ``share`` (N,)."""
    return np.column_stack([share**power for power in POWERS])


def product_columns(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Shape (N, len(PRODUCTS)), of two sensors' shares, each (N,)."""
    return np.column_stack([first**a * second**b for a, b in PRODUCTS])


class CouplingColumns:
    """Columns by name; the sums of products of each block, shape (B, P, P)."""

    def __init__(
        self,
        target: np.ndarray,
        moved: dict[str, np.ndarray],
        constants: np.ndarray,
        block: np.ndarray,
        pairs: Iterable[tuple[str, str]] = (),
    ) -> None:
        """``target`` (N,), each of ``moved`` (N,), ``constants`` (N, C) in every fit, ``block`` (N,)."""
        columns = [constants]
        self.groups: dict[str | tuple[str, str], list[int]] = {}
        place = constants.shape[1]
        for name, share in moved.items():
            columns.append(curve_columns(share))
            self.groups[name] = list(range(place, place + len(POWERS)))
            place += len(POWERS)
        for first, second in pairs:
            columns.append(product_columns(moved[first], moved[second]))
            self.groups[first, second] = list(range(place, place + len(PRODUCTS)))
            place += len(PRODUCTS)
        self.always = list(range(constants.shape[1]))
        whole = np.column_stack([*columns, target])
        _, number = np.unique(block, return_inverse=True)
        self.rows = np.bincount(number)
        starts = np.flatnonzero(np.r_[True, np.diff(number) > 0])
        self.sums = np.stack(
            [piece.T @ piece for piece in np.split(whole, starts[1:])]
        )  # blocks lie one after another

    def places(self, chosen: Sequence[str | tuple[str, str]]) -> list[int]:
        return [*self.always, *(place for name in chosen for place in self.groups[name])]

    def solve(self, chosen: Sequence[str | tuple[str, str]], weight: np.ndarray) -> np.ndarray:
        """Coefficients (of ``places``), each block counted ``weight`` (B,) times."""
        return _solve(np.tensordot(weight, self.sums, 1), self.places(chosen))

    def held_out_rms(self, chosen: Sequence[str | tuple[str, str]]) -> float:
        """RMS error on held-out blocks, every fifth at a time."""
        places, total, squared = self.places(chosen), self.sums.sum(axis=0), 0.0
        for fold in range(FOLDS):
            held_out = self.sums[fold::FOLDS].sum(axis=0)
            b = _solve(total - held_out, places)
            inner = held_out[np.ix_(places, places)]
            squared += float(held_out[-1, -1] - 2 * b @ held_out[places, -1] + b @ inner @ b)
        return float(np.sqrt(max(squared, 0.0) / self.rows.sum()))


def _solve(sums: np.ndarray, places: list[int]) -> np.ndarray:
    gram = sums[np.ix_(places, places)]
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-12))
    scaled = gram / np.outer(scale, scale) + RIDGE * np.eye(len(places))
    return np.linalg.solve(scaled, sums[places, -1] / scale) / scale
