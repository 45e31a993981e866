"""The held-out error that columns save, for a whole grid of nonlinear parameters at once.

Sums of squares and products are formed once for each unit (a take, or a stretch of one); every fold is then
the total without one unit, solved in closed form. The parameters are chosen inside each fold by its training
error.

The base is a static map of a joint's inputs, flexible enough to stand for its regressor and linear in its
coefficients: the first input in Legendre polynomials, further inputs with products (total degree), because a
missing product is mistaken for another effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from glovecal_models.calibration.sample_weight import effective_sample_ratio, sample_noise
from glovecal_models.effects.base.assessment import saved_share
from glovecal_models.effects.base.signals import as_slice

BASE_RIDGE = 1e-6
ALIKE_ROWS = 100.0
"""Rows that count for one: errors of neighbouring times are alike."""
LEAST_RIDGE = 1e-9
"""Of a column's own square: folds of a perfect fit stay solvable in spite of rounding."""
LEAST_VARIANCE_DEG2 = 1e-12
"""Of what is left: without it nothing would hold the weights of columns that are zero."""
OWN_DEGREE = 7
TOTAL_DEGREE = {1: 0, 2: 4, 3: 4, 4: 3, 5: 2}
"""Of products, by the number of inputs; 2 above."""
ROWS_PER_COLUMN = 10
"""Fewer rows do not carry so many products."""


@dataclass(frozen=True)
class Rows:
    """One unit's rows for one joint."""

    base: np.ndarray
    """(N, P)."""
    target: np.ndarray
    """(N,), degrees."""
    weight: np.ndarray | None = None
    """(N,), relative precision of each row, 1 on average over all units; None: all alike."""

    def weighted(self, columns: np.ndarray) -> np.ndarray:
        """Columns (N, ...) times the weights: products with others are then those of weighted least
        squares."""
        if self.weight is None:
            return columns
        return columns * self.weight.reshape(-1, *(1,) * (columns.ndim - 1))

    def rooted(self, residual: np.ndarray) -> np.ndarray:
        """Residuals (N,) times the root of the weights: all of one size where the weights are right."""
        return residual if self.weight is None else residual * np.sqrt(self.weight)


@dataclass(frozen=True)
class HeldOut:
    """Squared errors on units left out; weighted where rows have weights."""

    base: np.ndarray
    """(U,) sum of squared errors without the columns."""
    added: np.ndarray
    """(U,) with them."""
    count: np.ndarray
    """(U,) rows."""
    shape: int
    """Index of the shape that fits all units best."""
    weights: np.ndarray
    """(C,) at that shape, from all units."""
    fitted: float
    """Sum of squared errors over all units at that shape, nothing left out."""
    residual: tuple[np.ndarray, ...]
    """For each unit (N,): held-out error without the columns, degrees, as ``Rows.rooted``."""
    residual_added: tuple[np.ndarray, ...]

    @property
    def saved(self) -> float:
        """Share of the held-out squared error that the columns save; negative when they harm."""
        return saved_share(self.base, self.added)


def with_precision(units: Sequence[Rows], variance: Sequence[np.ndarray | None]) -> list[Rows]:
    """The units with weights from stated variances (N,) of their rows, degrees squared: 0 where a unit states
    none. Unchanged where no unit states any, or all state the same.

    What the base leaves beside the stated variances is added to each (``calibration.sample_weight``).
    """
    if all(part is None for part in variance):
        return list(units)
    counts = [len(rows.target) for rows in units]
    stated = np.concatenate(
        [np.zeros(n) if part is None else part for n, part in zip(counts, variance, strict=True)]
    )
    alike = BaseProducts(units)
    left = [rows.target - alike.fitted(rows.base) for rows in units]
    noise = sample_noise(stated, np.concatenate(left)) if len(stated) else None
    if noise is None:
        return list(units)
    weights = np.split(noise.precision / noise.precision.mean(), np.cumsum(counts)[:-1])
    return [replace(rows, weight=part) for rows, part in zip(units, weights, strict=True)]


class BaseProducts:
    """The part that all candidates share."""

    def __init__(
        self, units: Sequence[Rows], prior_sd: np.ndarray | None = None, own: int | None = None
    ) -> None:
        """``prior_sd`` (P,) of the coefficients, infinite (default) for those that are free; ``own``: so many
        columns are the base's own (None: all), further ones an effect's."""
        self.units = units
        self.prior_sd = np.full(units[0].base.shape[1], np.inf) if prior_sd is None else prior_sd
        self.gram = np.array([rows.weighted(rows.base).T @ rows.base for rows in units])
        self.right = np.array([rows.base.T @ rows.weighted(rows.target) for rows in units])
        self.square = np.array([rows.target @ rows.weighted(rows.target) for rows in units])
        self.count = np.array([len(rows.target) for rows in units])
        total = self.gram.sum(axis=0)
        self.own = len(total) if own is None else own
        size = np.diagonal(total)
        # An effect's columns may be a thousand times larger: they must not change how the base is held.
        held = np.where(size > 0.0, LEAST_RIDGE * size, 1.0)  # a column that is zero gets no weight
        held[: self.own] = BASE_RIDGE * size[: self.own].mean()
        self.ridge = np.diag(held)
        if np.isfinite(self.prior_sd).any():
            self.ridge += np.diag(self._held_by(self.prior_sd))
        left = total - self.gram + self.ridge
        self.coefficients = np.linalg.solve(left, (self.right.sum(axis=0) - self.right)[:, :, None])[:, :, 0]
        self.residual = tuple(
            rows.target - rows.base @ beta for rows, beta in zip(units, self.coefficients, strict=True)
        )
        self.error = np.array([rows.weighted(r) @ r for rows, r in zip(units, self.residual, strict=True)])
        self.whole = np.linalg.solve(total + self.ridge, self.right.sum(axis=0))

    @cached_property
    def beside(self) -> tuple[np.ndarray, ...]:
        """For each unit (N, P + 1): its base and its target."""
        return tuple(np.column_stack([rows.base, rows.target]) for rows in self.units)

    @cached_property
    def rooted_residual(self) -> tuple[np.ndarray, ...]:
        """For each unit (N,): held-out error, degrees, as ``Rows.rooted``."""
        return tuple(rows.rooted(part) for rows, part in zip(self.units, self.residual, strict=True))

    def _held_by(self, prior_sd: np.ndarray) -> np.ndarray:
        """(P,) of the ridge, as for the columns of an effect; the noise is what all columns leave."""
        total, right = self.gram.sum(axis=0), self.right.sum(axis=0)
        beta = np.linalg.solve(total + self.ridge, right)
        left = self.square.sum() + beta @ total @ beta - 2 * beta @ right
        return ALIKE_ROWS * max(left / self.count.sum(), LEAST_VARIANCE_DEG2) / prior_sd**2

    def fitted(self, base: np.ndarray) -> np.ndarray:
        """The map of all units, (N,) degrees."""
        return base @ self.whole


@dataclass(frozen=True)
class FittedRows:
    """Where several joints, the lanes of an effect, are fitted."""

    rows: tuple[np.ndarray | slice, ...]
    """For each take the M rows that some of the joints are fitted on."""
    places: tuple[tuple[tuple[int, slice | np.ndarray], ...], ...]
    """For each lane and unit its take, and the unit's rows among those."""

    @classmethod
    def of(cls, lengths: Sequence[int], units: Sequence[Sequence[tuple[int, np.ndarray]]]) -> FittedRows:
        """Of takes with so many rows; ``units``: for each lane the take and the rows of each of its units."""
        is_fitted = [np.zeros(length, dtype=bool) for length in lengths]
        for take, index in (unit for of_lane in units for unit in of_lane):
            is_fitted[take][index] = True
        place = [np.cumsum(mask) - 1 for mask in is_fitted]
        return cls(
            tuple(as_slice(np.flatnonzero(mask)) for mask in is_fitted),
            tuple(
                tuple((take, as_slice(place[take][index])) for take, index in of_lane) for of_lane in units
            ),
        )


@dataclass(frozen=True)
class FittedColumns:
    """Columns of an effect on several joints, its lanes: put in the order of fits in memory once, and only
    where some joint is fitted."""

    columns: tuple[np.ndarray, ...]
    """For each take (L, M, G, C)."""
    fitted: FittedRows

    @classmethod
    def of(
        cls, columns: Sequence[np.ndarray], fitted: FittedRows, *, are_fitted: bool = False
    ) -> FittedColumns:
        """``columns``: for each take (N, G L, C), lane by lane within each of the G shapes; or at the fitted
        rows only where they ``are_fitted``."""
        lanes = len(fitted.places)
        # One take after the other: all at once would be too much for the processor's cache.
        some = columns if are_fitted else (part[at] for part, at in zip(columns, fitted.rows, strict=True))
        return cls(tuple(_by_lane(part, lanes) for part in some), fitted)

    def units(self, lane: int) -> list[np.ndarray]:
        """(N, G, C) of each unit of one lane."""
        return [self.columns[take][lane, rows] for take, rows in self.fitted.places[lane]]


def _by_lane(columns: np.ndarray, lanes: int) -> np.ndarray:
    """(L, M, G, C) of (M, G L, C)."""
    apart = columns.reshape(len(columns), columns.shape[1] // lanes, lanes, columns.shape[2])
    return np.ascontiguousarray(apart.transpose(2, 0, 1, 3))


def held_out(
    products: BaseProducts,
    columns: Sequence[np.ndarray],
    prior_sd: np.ndarray,
    noise_variance: float | None = None,
) -> HeldOut:
    """``columns``: for each unit (N, G, C); ``prior_sd`` (C,) of their weights.

    ``noise_variance``: what the columns leave, degrees squared, where known; else what the base leaves.
    """
    size = products.gram.shape[1]
    shapes, added = columns[0].shape[1:]
    # With the base and with the target at once.
    crossed = np.empty((len(columns), shapes * added, size + 1))
    inner = np.empty((len(columns), shapes, added, added))
    for unit, (rows, extra) in enumerate(zip(products.units, columns, strict=True)):
        counted = rows.weighted(extra)
        np.matmul(counted.reshape(len(extra), shapes * added).T, products.beside[unit], out=crossed[unit])
        np.matmul(counted.transpose(1, 2, 0), extra.transpose(1, 0, 2), out=inner[unit])
    by_shape = crossed.reshape(len(columns), shapes, added, size + 1)
    joint = np.empty((len(columns), shapes, size + added, size + added))
    joint[:, :, :size, :size] = products.gram[:, None]
    joint[:, :, size:, :size] = by_shape[..., :size]
    joint[:, :, :size, size:] = by_shape[..., :size].swapaxes(2, 3)
    joint[:, :, size:, size:] = inner
    right = np.empty((len(columns), shapes, size + added))
    right[:, :, :size] = products.right[:, None]
    right[:, :, size:] = by_shape[..., size]
    total, total_right = joint.sum(axis=0), right.sum(axis=0)
    ridge = np.zeros((shapes, size + added))
    ridge[:, :size] = np.diagonal(products.ridge)
    variance = products.error.sum() / products.count.sum() if noise_variance is None else noise_variance
    variance = max(variance, LEAST_VARIANCE_DEG2)
    own_square = np.diagonal(total, axis1=1, axis2=2)[:, size:]
    ridge[:, size:] = np.maximum(ALIKE_ROWS * variance / prior_sd**2, LEAST_RIDGE * own_square)
    beta = _solved(total - joint, total_right - right, ridge)
    training = (products.square.sum() - products.square)[:, None] + _quadratic(
        total_right - right, beta, ridge
    )
    best = np.argmin(training, axis=1)
    chosen = beta[np.arange(len(columns)), best]
    of_base = np.column_stack([-chosen[:, :size], np.ones(len(columns))])
    residual = tuple(
        rows.rooted(beside @ own - extra[:, g, :] @ b)
        for rows, beside, own, extra, g, b in zip(
            products.units, products.beside, of_base, columns, best.tolist(), chosen[:, size:], strict=True
        )
    )
    whole = _solved(total, total_right, ridge)  # the last use of ``total``
    fit = products.square.sum() + _quadratic(total_right, whole, ridge)
    shape = int(np.argmin(fit))
    return HeldOut(
        base=products.error,
        added=np.array([r @ r for r in residual]),
        count=products.count,
        shape=shape,
        weights=whole[shape, size:],
        fitted=float(fit[shape]),
        residual=products.rooted_residual,
        residual_added=residual,
    )


@dataclass(frozen=True)
class WeightPosterior:
    """Weights of columns as all units tell them."""

    mean: np.ndarray
    """(C,)."""
    covariance: np.ndarray
    """(C, C) beside the base as it is: its own uncertainty is the regressor's to tell."""

    def part(self, some: slice) -> WeightPosterior:
        """Of some of the columns."""
        return WeightPosterior(self.mean[some], self.covariance[some, some])


def weight_posterior(
    units: Sequence[Rows], columns: Sequence[np.ndarray], prior_sd: np.ndarray
) -> WeightPosterior:
    """``columns``: for each unit (N, C); ``prior_sd`` (C,) of their weights."""
    both = [np.column_stack([rows.base, extra]) for rows, extra in zip(units, columns, strict=True)]
    pairs = list(zip(both, units, strict=True))
    gram = np.sum([rows.weighted(part).T @ part for part, rows in pairs], axis=0)
    right = np.sum([part.T @ rows.weighted(rows.target) for part, rows in pairs], axis=0)
    square = float(sum(rows.target @ rows.weighted(rows.target) for rows in units))
    count = max(sum(len(rows.target) for rows in units), 1)
    size = units[0].base.shape[1]
    base = np.arange(len(gram)) < size
    ridge = np.where(base, BASE_RIDGE * np.trace(gram[:size, :size]) / size, 0.0)
    first = np.linalg.solve(gram[:size, :size] + np.diag(ridge[:size]), right[:size])
    left = square + float(first @ gram[:size, :size] @ first - 2 * first @ right[:size])
    beta, held, variance = first, gram, LEAST_VARIANCE_DEG2
    # The base's error has the effects in it, as if they were noise: weights held by it stay too small.
    for _ in range(2):
        variance = max(left / count, LEAST_VARIANCE_DEG2)
        prior = ALIKE_ROWS * variance / prior_sd**2
        ridge[size:] = np.maximum(prior, LEAST_RIDGE * np.diagonal(gram)[size:])
        held = gram + np.diag(ridge)
        beta = _solved(gram.copy(), right, ridge)
        left = square + float(beta @ gram @ beta - 2 * beta @ right)
    own, pull = held[size:, size:], ridge[size:]
    scale = np.sqrt(np.diagonal(own))
    inverse = np.linalg.inv(own / (scale[:, None] * scale)) / (scale[:, None] * scale)
    error = [rows.rooted(rows.target - part @ beta) for part, rows in pairs]
    # What is held against chance is held against ``ALIKE_ROWS``; what is left unknown is as it is: the noise
    # of the rows that count as independent, and the prior's share of what the ridge pulls towards zero.
    alike = min(1 / _effective_ratio(error), ALIKE_ROWS)
    noise = alike * variance * inverse @ gram[size:, size:] @ inverse
    covariance = noise + ALIKE_ROWS * variance * (inverse * pull) @ inverse
    return WeightPosterior(beta[size:], covariance)


def _effective_ratio(error: Sequence[np.ndarray]) -> float:
    """Independent rows per row, from the errors (N,) of each unit."""
    unit = np.repeat(np.arange(len(error)), [len(part) for part in error])
    return effective_sample_ratio(np.concatenate(error), unit, np.arange(len(unit)))


def _solved(gram: np.ndarray, right: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    """With ``ridge`` (..., K) on the diagonal of ``gram`` (..., K, K), which is overwritten; with columns of
    any size: each is brought to a square of one first."""
    diagonal = np.einsum("...ii->...i", gram)
    diagonal += ridge
    size = np.sqrt(diagonal)
    gram /= size[..., :, None]
    gram /= size[..., None, :]
    return np.linalg.solve(gram, (right / size)[..., None])[..., 0] / size


def _quadratic(right: np.ndarray, beta: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    """Squared error, without the target's own square, of ``beta`` that solves the products with ``ridge``."""
    return -np.einsum("...i,...i->...", right + ridge * beta, beta)


@dataclass(frozen=True)
class BaseFeatures:
    """Scales inputs to -1..1 over the training takes and expands them."""

    centre: np.ndarray
    half: np.ndarray
    linear: bool
    degree: int = 0
    """Of products."""

    @classmethod
    def fit_constants(cls, inputs: Sequence[np.ndarray], *, linear: bool = False) -> BaseFeatures:
        """``inputs``: for each take (N, D), the measuring sensor first."""
        low = np.min([part.min(axis=0) for part in inputs if len(part)], axis=0)
        high = np.max([part.max(axis=0) for part in inputs if len(part)], axis=0)
        rows, dimensions = sum(map(len, inputs)), len(low)
        degree = TOTAL_DEGREE.get(dimensions, 2)
        while degree > 1 and comb(dimensions + degree, degree) > rows / ROWS_PER_COLUMN:
            degree -= 1
        return cls((low + high) / 2, np.maximum((high - low) / 2, 1e-9), linear, degree)

    def columns(self, inputs: np.ndarray) -> np.ndarray:
        """(N, P), the first column ones."""
        x = np.clip((inputs - self.centre) / self.half, -1.5, 1.5)
        if self.linear:
            return np.column_stack([np.ones(len(x)), x])
        own = np.polynomial.legendre.legvander(x[:, 0], OWN_DEGREE)
        dimensions = x.shape[1]
        degree = self.degree
        powers = [np.polynomial.legendre.legvander(x[:, d], max(degree, 1)) for d in range(dimensions)]
        extra = []
        for total in range(1, degree + 1):
            for chosen in combinations_with_replacement(range(dimensions), total):
                if set(chosen) == {0}:
                    continue
                product = np.ones(len(x))
                for d in set(chosen):
                    product = product * powers[d][:, chosen.count(d)]
                extra.append(product)
        return np.column_stack([own, *extra])
