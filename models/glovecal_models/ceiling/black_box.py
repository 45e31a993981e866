"""A black box of three parts: a line in all columns, boosted trees on what it leaves, products of columns.

The line carries what goes on beyond the range of the training takes, where trees stand still. Products (of
the reading with its running averages) carry a memory that depends on the bend, which trees resolve only in
steps. Each part is multiplied by a number from 0 to 1 that the other takes choose: a box that has learned
nothing predicts nothing, so that flexibility alone costs no error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from threadpoolctl import threadpool_limits

from glovecal_models.errors import BadInput
from glovecal_models.installation import not_installed

RIDGE_SHARE = 0.02
"""Penalty as a share of the rows, for columns of standard deviation one."""
PRODUCT_RIDGE_SHARES = (1e-3, 1e-2, 1e-1)
"""Among them the training takes choose, each third of them left out."""
TREES = 60
LEARNING_RATE = 0.1
LEAVES = 12
ROWS_IN_A_LEAF = 36
"""Six seconds: neighbouring rows say nearly the same."""
TREE_BINS = 63
COLUMNS_TRIED = 0.4
FOLDS = 4
PARTS = 3


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
    products: Sequence[tuple[int, ...]] = (),
) -> Left:
    """``columns`` (N, P), NaN where unknown; ``target`` (N,); ``take`` (N,) numbers from 0, each with rows.

    ``exchanged``: for groups of columns their place, and what stands there instead (N, columns).
    ``products``: places of columns that are multiplied with one another.
    """
    exchanged = exchanged or {}
    count = int(take.max()) + 1
    parts = np.zeros((PARTS, len(target)))
    other = {name: np.zeros((PARTS, len(target))) for name in exchanged}
    with threadpool_limits(limits=1):
        for fold in range(min(FOLDS, count)):
            held = take % min(FOLDS, count) == fold
            box = _Box(columns[~held], target[~held], take[~held], seed, products)
            parts[:, held] = box.predict(columns[held])
            for name, (place, values) in exchanged.items():
                changed = columns[held].copy()
                changed[:, place] = values[held]
                other[name][:, held] = box.predict(changed)
    shares = _shares(parts, target, take, count)[:, take]

    def squares(predicted: np.ndarray) -> np.ndarray:
        return np.bincount(take, (target - (shares * predicted).sum(axis=0)) ** 2, count)

    return Left(squares(parts), {name: squares(values) for name, values in other.items()})


class _Box:
    """Fitted to some takes."""

    def __init__(
        self, columns: np.ndarray, target: np.ndarray, take: np.ndarray, seed: int,
        products: Sequence[tuple[int, ...]],
    ) -> None:  # fmt: skip
        try:
            from sklearn.ensemble import HistGradientBoostingRegressor  # a second to import
        except ModuleNotFoundError as error:
            raise BadInput(not_installed("the ceiling", "scikit-learn")) from error
        self._products = products
        self._standard = _Standard(columns)
        x = self._standard.of(columns)
        self._level = float(target.mean())
        gram = x.T @ x + RIDGE_SHARE * len(x) * np.eye(x.shape[1])
        self._weights = np.linalg.solve(gram, x.T @ (target - self._level))
        left = target - self._line(x)
        if products:
            multiplied = self._multiplied(x)
            self._standard_products = _Standard(multiplied)
            bank = self._standard_products.of(multiplied)
            # Not of what the line leaves: that follows other columns by chance, and would hide a memory.
            self._product_weights = _ridge(bank, target - self._level, take)
        self._trees = HistGradientBoostingRegressor(
            max_iter=TREES, learning_rate=LEARNING_RATE, max_leaf_nodes=LEAVES,
            min_samples_leaf=ROWS_IN_A_LEAF, max_bins=TREE_BINS, max_features=COLUMNS_TRIED,
            early_stopping=False,  # pyright: ignore[reportArgumentType]
            random_state=seed,
        )  # fmt: skip
        # Trees cannot be grown on a column of which nothing is known, such as the past in takes of a second.
        self._trees.fit(columns[:, self._standard.known], left)

    def predict(self, columns: np.ndarray) -> np.ndarray:
        """(parts, N)"""
        x = self._standard.of(columns)
        bank = np.zeros(len(x))
        if self._products:
            bank = self._standard_products.of(self._multiplied(x)) @ self._product_weights
        return np.stack([self._line(x), bank, self._trees.predict(columns[:, self._standard.known])])

    def _line(self, x: np.ndarray) -> np.ndarray:
        return self._level + x @ self._weights

    def _multiplied(self, x: np.ndarray) -> np.ndarray:
        single = dict.fromkeys(place for places in self._products for place in places)
        return np.column_stack(
            [
                x[:, list(single)],
                *(np.prod(x[:, list(places)], axis=1) for places in self._products),
            ]
        )


class _Standard:
    """Columns with the mean and the standard deviation that they had in training; unknown is the mean."""

    def __init__(self, columns: np.ndarray) -> None:
        known = np.isfinite(columns)
        counts = np.maximum(known.sum(axis=0), 1)
        self.known = known.any(axis=0)
        self._mean = np.where(known, columns, 0.0).sum(axis=0) / counts
        spread = np.sqrt((np.where(known, columns - self._mean, 0.0) ** 2).sum(axis=0) / counts)
        self._scale = np.where(spread > 0, spread, np.inf)

    def of(self, columns: np.ndarray) -> np.ndarray:
        return np.nan_to_num((columns - self._mean) / self._scale)


def _ridge(x: np.ndarray, target: np.ndarray, take: np.ndarray) -> np.ndarray:
    """Weights with the penalty that leaves least on takes left out."""
    thirds = np.unique(take, return_inverse=True)[1] % 3
    grams = [x[thirds == third].T @ x[thirds == third] for third in range(3)]
    products = [x[thirds == third].T @ target[thirds == third] for third in range(3)]

    def weights(penalty: float, without: int | None) -> np.ndarray:
        kept = [third for third in range(3) if third != without]
        rows = sum(int(np.count_nonzero(thirds == third)) for third in kept)
        gram = sum(grams[third] for third in kept) + penalty * max(rows, 1) * np.eye(x.shape[1])
        return cho_solve(cho_factor(gram), sum(products[third] for third in kept))

    def left(penalty: float) -> float:
        found = [weights(penalty, third) for third in range(3)]
        return sum(
            float(w @ gram @ w - 2 * w @ product)
            for w, gram, product in zip(found, grams, products, strict=True)
        )

    return weights(min(PRODUCT_RIDGE_SHARES, key=left), None)


def _shares(parts: np.ndarray, target: np.ndarray, take: np.ndarray, count: int) -> np.ndarray:
    """(parts, takes): for each take what multiples of the parts, 0 to 1, fit the other takes best."""
    from scipy.optimize import lsq_linear  # slow to load

    rows = [parts[:, take == number] for number in range(count)]
    grams = np.array([part @ part.T for part in rows])
    products = np.array([part @ target[take == number] for number, part in enumerate(rows)])
    found = np.zeros((len(parts), count))
    for number in range(count):
        gram = grams.sum(axis=0) - grams[number]
        gram[np.diag_indices(len(parts))] += 1e-9 * max(float(np.trace(gram)), 1e-12)
        root = np.linalg.cholesky(gram).T
        wanted = np.linalg.solve(root.T, products.sum(axis=0) - products[number])
        found[:, number] = lsq_linear(root, wanted, (0.0, 1.0), method="bvls").x
    return found
