"""A black box: a ridge regression, then gradient-boosted trees on what it leaves; whole takes left out.

The line carries what goes on beyond the range of the training takes, where trees stand still. Each of the
two is multiplied by a number from 0 to 1 that the other takes choose: a box that has learned nothing predicts
nothing, so that flexibility alone costs no error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

RIDGE_SHARE = 0.02
"""Penalty as a share of the rows, for columns of standard deviation one."""
TREES = 60
LEARNING_RATE = 0.1
LEAVES = 12
ROWS_IN_A_LEAF = 36
"""Six seconds: neighbouring rows say nearly the same."""
TREE_BINS = 63
COLUMNS_TRIED = 0.4
FOLDS = 4


@dataclass(frozen=True)
class Left:
    """What the box leaves of a target on takes it has not seen."""

    square: np.ndarray
    """For each take, the squared error summed over its rows."""
    without: Mapping[str, np.ndarray]
    """The same, with a group of columns exchanged for those of another take."""


def left_by_box(
    columns: np.ndarray,
    target: np.ndarray,
    take: np.ndarray,
    seed: int,
    exchanged: Mapping[str, tuple[slice, np.ndarray]] | None = None,
) -> Left:
    """``columns`` (N, P), NaN where unknown; ``target`` (N,); ``take`` (N,) numbers from 0, each with rows.

    ``exchanged``: for groups of columns their place, and what stands there instead (N, columns).
    """
    exchanged = exchanged or {}
    count = int(take.max()) + 1
    line, trees = np.zeros(len(target)), np.zeros(len(target))
    other = {name: np.zeros((2, len(target))) for name in exchanged}
    with threadpool_limits(limits=1):
        for fold in range(min(FOLDS, count)):
            held = take % min(FOLDS, count) == fold
            box = _Box(columns[~held], target[~held], seed)
            line[held], trees[held] = box.predict(columns[held])
            for name, (place, values) in exchanged.items():
                changed = columns[held].copy()
                changed[:, place] = values[held]
                other[name][:, held] = box.predict(changed)
    line_share = _shares(line, target, take, count)
    trees_share = _shares(trees, target - line_share * line, take, count)

    def squares(by_line: np.ndarray, by_trees: np.ndarray) -> np.ndarray:
        return np.bincount(take, (target - line_share * by_line - trees_share * by_trees) ** 2, count)

    return Left(squares(line, trees), {name: squares(*parts) for name, parts in other.items()})


class _Box:
    """Fitted to some takes."""

    def __init__(self, columns: np.ndarray, target: np.ndarray, seed: int) -> None:
        from sklearn.ensemble import HistGradientBoostingRegressor  # a second to import

        known = np.isfinite(columns)
        counts = np.maximum(known.sum(axis=0), 1)
        self._some = known.any(axis=0)
        self._mean = np.where(known, columns, 0.0).sum(axis=0) / counts
        spread = np.sqrt((np.where(known, columns - self._mean, 0.0) ** 2).sum(axis=0) / counts)
        self._scale = np.where(spread > 0, spread, np.inf)
        x = self._scaled(columns)
        self._level = float(target.mean())
        gram = x.T @ x + RIDGE_SHARE * len(x) * np.eye(x.shape[1])
        self._weights = np.linalg.solve(gram, x.T @ (target - self._level))
        self._trees = HistGradientBoostingRegressor(
            max_iter=TREES, learning_rate=LEARNING_RATE, max_leaf_nodes=LEAVES,
            min_samples_leaf=ROWS_IN_A_LEAF, max_bins=TREE_BINS, max_features=COLUMNS_TRIED,
            early_stopping=False,  # pyright: ignore[reportArgumentType]
            random_state=seed,
        )  # fmt: skip
        # Trees cannot be grown on a column of which nothing is known, such as the past in takes of a second.
        self._trees.fit(columns[:, self._some], target - self._line(x))

    def predict(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._line(self._scaled(columns)), self._trees.predict(columns[:, self._some])

    def _line(self, scaled: np.ndarray) -> np.ndarray:
        return self._level + scaled @ self._weights

    def _scaled(self, columns: np.ndarray) -> np.ndarray:
        return np.nan_to_num((columns - self._mean) / self._scale)


def _shares(predicted: np.ndarray, target: np.ndarray, take: np.ndarray, count: int) -> np.ndarray:
    """For each row the multiple of ``predicted`` that fits the other takes best, 0 to 1."""
    product = np.bincount(take, predicted * target, count)
    square = np.bincount(take, predicted**2, count)
    share = (product.sum() - product) / np.maximum(square.sum() - square, 1e-12)
    return np.clip(share, 0.0, 1.0)[take]
