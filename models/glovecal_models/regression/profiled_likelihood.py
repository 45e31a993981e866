"""What exact and low-rank likelihoods share: plane and scale profiled out of the marginal likelihood.

Model of Wang & Neff (2013), equations 7, 8 and 11, in standardised units:
y ~ N(H b, s^2 (k_theta + rho I)). For given theta (log lengthscales) and log rho the best b is generalised
least squares and the best s^2 is the mean weighted residual (Rasmussen & Williams 2006, section 2.7, in the
limit of no prior on b), which leaves D + 1 parameters to search instead of 3 D + 3.

Both work on S K S + rho I "inside" a space of small dimension; what lies "outside" it (scatter of merged
samples, directions no node reaches) sees only the noise rho I and enters through a Gram matrix.

Low-rank approximations of the marginal likelihood, and how far from it they can be.

Search: nodes are chosen once by pivoted Cholesky at shorter lengthscales than those to be searched. Functions
of the longer lengthscales are then interpolated from the nodes by weights W (N, r) that do not depend on the
hyperparameters: K(theta) ~ W Kzz(theta) W'. With one QR factorisation [S W, columns] = Q R each evaluation
needs only r x r matrices: P Kzz P' + rho I, P the triangular corner of R. Kin: structured kernel
interpolation (Wilson & Nickisch 2015), but on r well-chosen nodes in place of a grid, and the fixed basis of
Solin & Sarkka (2020), but for any inputs.

Certificate: with K = Q + E, Q = L L' from pivoted Cholesky, E positive semidefinite with trace t in units of
the signal variance s^2, and noise rho s^2:

    log|Q + rho I| <= log|K + rho I| <= log|Q + rho I| + t / rho              (Titsias 2009, equation 9)
    r' (Q + (rho + t) I)^-1 r <= r' (K + rho I)^-1 r <= r' (Q + rho I)^-1 r   (largest eigenvalue of E <= t)

So the exact NLML at given hyperparameters lies in a bracket that tightens as pivots are added.

The exact marginal likelihood with plane and scale profiled out: O(m^3) for m distinct inputs.

One evaluation is one Cholesky factorisation; its derivatives add one inverse in place, of which only a
triangle is made and read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glovecal_models.regression.factorisation import (
    PivotedCholesky,
    pivoted_cholesky,
    posv,
    potrf,
    potri,
    symm,
    trmm,
    trsm,
    trtrs,
)
from glovecal_models.regression.training_samples import MergedSamples

LOG_2_PI = float(np.log(2.0 * np.pi))
SMALLEST_SCALE = 1e-20
"""Reached only by targets that are a plane to all digits."""

Derivatives = tuple[np.ndarray, np.ndarray]
"""Gradient (D + 1,) by log lengthscales and log rho, and average information (D + 1, D + 1)."""


@dataclass(frozen=True)
class Profile:
    """The likelihood at the best plane and scale."""

    nlml: float
    scale: float
    """s^2: signal variance, standardised units squared."""
    plane: np.ndarray
    """Coefficients of the plane's basis, shape (p,)."""
    residual: np.ndarray
    """Combination of the columns that is the residual: [-plane, 1], shape (p + 1,)."""
    gram: np.ndarray
    """columns' (K + rho I)^-1 columns, shape (p + 1, p + 1)."""


@dataclass(frozen=True)
class Evaluation:
    """The likelihood at one point; derivatives are computed when asked for, once at most."""

    profile: Profile
    derivatives: Callable[[], Derivatives]

    @property
    def nlml(self) -> float:
        return self.profile.nlml


def profile(gram: np.ndarray, log_determinant: float, total: float) -> Profile:
    """From columns' K^-1 columns (p+1, p+1) of [basis, target], log |K + rho I| and N."""
    p = len(gram) - 1
    _, plane, info = posv(gram[:p, :p], gram[:p, p])
    if info != 0:
        plane = np.linalg.lstsq(gram[:p, :p], gram[:p, p], rcond=None)[0]
    residual = np.append(-plane, 1.0)
    scale = max(float(residual @ gram @ residual) / total, SMALLEST_SCALE)
    nlml = 0.5 * (total * (np.log(scale) + 1.0 + LOG_2_PI) + log_determinant)
    return Profile(float(nlml), scale, plane, residual, gram)


def moved_by_lengthscales(kernel: np.ndarray, points: np.ndarray, pulled: np.ndarray) -> np.ndarray:
    """(dK / d log l_d) pulled for each d, shape (r, D); ``points`` (r, D) are inputs over lengthscales.

    dK_ij / d log l_d = K_ij (x_id - x_jd)^2, expanded so that K is read once.
    """
    dimensions = points.shape[1]
    squares = points * points
    column = pulled[:, None]
    moments = kernel @ np.column_stack([column, points * column, squares * column])
    once, twice = moments[:, 1 : 1 + dimensions], moments[:, 1 + dimensions :]
    return squares * moments[:, :1] - 2.0 * points * once + twice


def trace_by_lengthscales(sums: np.ndarray, crossed: np.ndarray, points: np.ndarray) -> np.ndarray:
    """sum_ij M_ij (x_id - x_jd)^2 for each d, from M's row sums and M @ points, M symmetric."""
    return 2.0 * (sums @ (points * points) - np.einsum("ij,ij->j", points, crossed))


@dataclass(frozen=True)
class Inside:
    """What derivatives need from either likelihood, apart from traces."""

    total: float
    rho: float
    columns: np.ndarray
    """Whitened columns inside, shape (r, p + 1)."""
    outside: np.ndarray
    """Gram matrix of the columns outside, shape (p + 1, p + 1)."""


def derivatives(best: Profile, inside: Inside, traces: np.ndarray, moved: np.ndarray) -> Derivatives:
    """Gradient and average information (Gilmour, Thompson & Cullis 1995), scale profiled.

    ``traces``: trace(K^-1 dK) by each parameter, shape (D + 1,). ``moved``: whitened dK K^-1 residual
    inside, shape (r, D + 1). The average information is the mean of observed and expected information,
    costs one more solve with D + 1 right-hand sides, and is never indefinite.
    """
    rho, v, p = inside.rho, best.residual, len(best.plane)
    products = moved.T @ moved
    with_columns = moved.T @ inside.columns
    noise = inside.outside @ v / rho
    with_columns[-1] += noise
    products[-1, -1] += float(v @ noise)
    with_residual = with_columns @ v
    gradient = 0.5 * (traces - with_residual / best.scale)
    across = with_columns[:, :p]
    projected = products - across @ np.linalg.lstsq(best.gram[:p, :p], across.T, rcond=None)[0]
    projected -= np.outer(with_residual, with_residual) / (inside.total * best.scale)
    return gradient, projected / (2.0 * best.scale)


def squared_exponential(points: np.ndarray) -> np.ndarray:
    """exp(-|x_i - x_j|^2 / 2), shape (r, r), of inputs over lengthscales."""
    half_norm = -0.5 * np.einsum("ij,ij->i", points, points)
    gram = points @ points.T
    gram += half_norm[:, None]
    gram += half_norm[None, :]
    np.minimum(gram, 0.0, out=gram)
    return np.exp(gram, out=gram)


def cholesky(matrix: np.ndarray) -> np.ndarray | None:
    """Lower Cholesky factor of a symmetric matrix, overwriting it; None if it is not positive definite.

    A C-ordered symmetric matrix is its own Fortran-ordered transpose: no copy is made.
    """
    factor, info = potrf(matrix.T, lower=1, overwrite_a=1, clean=0)
    return factor if info == 0 else None


class LowRankLikelihood:
    """Trustworthy for lengthscales not shorter than ``base``."""

    def __init__(self, samples: MergedSamples, factor: PivotedCholesky, base: np.ndarray) -> None:
        self.base = base
        """Lengthscales at which the nodes were chosen, shape (D,)."""
        self.nodes = samples.inputs[factor.pivots]
        self.rank = factor.rank
        self._total = samples.total
        weights = trsm(1.0, factor.corner(), factor.rows.T, side=1, lower=1)
        weights *= samples.root_count[:, None]
        self._corner, self._columns, self._outside = _split_by_span(weights, samples.columns)
        self._outside[-1, -1] += samples.scatter

    @classmethod
    def at(
        cls, samples: MergedSamples, base: np.ndarray, tolerance: float, largest_rank: int
    ) -> LowRankLikelihood | None:
        """Choose nodes for lengthscales >= ``base``; None when that takes more than ``largest_rank``."""
        factor = pivoted_cholesky(samples.inputs / base, tolerance, largest_rank)
        return cls(samples, factor, base) if factor.complete else None

    def evaluate(self, parameters: np.ndarray) -> Evaluation | None:
        """The likelihood at (log lengthscales, log rho) (D + 1,); None where rounding breaks it."""
        points = self.nodes * np.exp(-parameters[:-1])
        rho = float(np.exp(parameters[-1]))
        kernel = squared_exponential(points)
        inner = trmm(1.0, self._corner, kernel.T)
        inner = trmm(1.0, self._corner, inner, side=1, trans_a=1, overwrite_b=1)
        inner.ravel(order="K")[:: self.rank + 1] += rho
        factor = cholesky(inner.T)
        if factor is None:
            return None
        whitened = trtrs(factor, self._columns, lower=1)[0]
        gram = whitened.T @ whitened + self._outside / rho
        log_determinant = 2.0 * float(np.log(factor.diagonal()).sum())
        log_determinant += (self._total - self.rank) * parameters[-1]
        best = profile(gram, log_determinant, self._total)
        inside = Inside(self._total, rho, whitened, self._outside)
        return Evaluation(best, lambda: self._derivatives(points, kernel, factor, best, inside))

    def _derivatives(
        self, points: np.ndarray, kernel: np.ndarray, factor: np.ndarray, best: Profile, inside: Inside
    ) -> Derivatives:
        half = trtrs(factor, self._corner, lower=1)[0]
        weighted = half.T @ half
        weighted *= kernel
        sums = weighted.sum(axis=1)
        traces = np.append(
            trace_by_lengthscales(sums, weighted @ points, points), self._total - float(sums.sum())
        )
        residual = inside.columns @ best.residual
        moved = half @ moved_by_lengthscales(kernel, points, half.T @ residual)
        solved = trtrs(factor, residual, lower=1, trans=1)[0]
        by_noise = trtrs(factor, inside.rho * solved, lower=1)[0]
        return derivatives(best, inside, traces, np.column_stack([moved, by_noise]))


def _split_by_span(weights: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """With weights = Q R: R (r, r), Q' columns (r, c), and the Gram matrix (c, c) of what Q leaves of them.

    By Cholesky of the Gram matrix where the weights are well conditioned, as they nearly always are: three
    times faster than Householder's QR.
    """
    gram = weights.T @ weights
    corner, info = potrf(gram.T, lower=0, clean=1, overwrite_a=1)
    diagonal = corner.diagonal()
    if info == 0 and diagonal.min() > 1e-6 * diagonal.max():
        inside = trtrs(corner, weights.T @ columns, lower=0, trans=1)[0]
        left = columns.T @ columns - inside.T @ inside
        return corner, inside, left
    q, r = np.linalg.qr(weights)
    inside = q.T @ columns
    left = columns - q @ inside
    return np.asfortranarray(r), inside, left.T @ left


@dataclass(frozen=True)
class Certificate:
    """The exact NLML (standardised units, scale and plane as given) is in [lower, upper]."""

    lower: float
    upper: float
    how: str
    """``trace bounds`` or ``exact evaluation``."""

    @property
    def width(self) -> float:
        return self.upper - self.lower


class NystromFit:
    """Plane, scale and likelihood of K ~ L L' for fixed lengthscales; any leading part of L."""

    def __init__(self, samples: MergedSamples, rows: np.ndarray, rho: float) -> None:
        """``rows`` (r, m): L transposed, unit signal variance, one column per distinct input."""
        self.samples, self.rho = samples, rho
        self.scaled = rows * samples.root_count
        self.gram = self.scaled @ self.scaled.T
        self.projected = self.scaled @ samples.columns
        self._columns = samples.columns.T @ samples.columns
        self._columns[-1, -1] += samples.scatter

    def profile(self) -> Profile:
        gram, log_determinant = self.inverse_gram(self.rho)
        return profile(gram, log_determinant, self.samples.total)

    def inverse_gram(self, noise: float) -> tuple[np.ndarray, float]:
        """columns' (L L' + noise I)^-1 columns, and log |L L' + noise I|."""
        rank = len(self.gram)
        inner = self.gram.copy()
        inner.ravel()[:: rank + 1] += noise
        factor, info = potrf(inner.T, lower=1, overwrite_a=1, clean=0)
        if info != 0:
            raise ArithmeticError(f"low-rank factor of rank {rank} is not positive definite at {noise:g}")
        half = trtrs(factor, self.projected, lower=1)[0]
        log_determinant = 2.0 * float(np.log(factor.diagonal()).sum())
        log_determinant += (self.samples.total - rank) * np.log(noise)
        return (self._columns - half.T @ half) / noise, log_determinant


def certify(fit: NystromFit, trace: float, plane: np.ndarray, scale: float) -> Certificate:
    """Bracket the exact NLML at rho, ``plane`` and ``scale`` (s^2); ``trace`` = trace of E, weighted."""
    residual = np.append(-plane, 1.0)
    total, rho = fit.samples.total, fit.rho
    gram, log_determinant = fit.inverse_gram(rho)
    shifted, _ = fit.inverse_gram(rho + trace)
    constant = total * (LOG_2_PI + np.log(scale)) + log_determinant
    upper = 0.5 * (constant + trace / rho + float(residual @ gram @ residual) / scale)
    lower = 0.5 * (constant + float(residual @ shifted @ residual) / scale)
    return Certificate(lower, upper, "trace bounds")


@dataclass(frozen=True)
class TrainingProcess:
    """The exact process at the distinct training inputs, standardised units."""

    profile: Profile
    weights: np.ndarray
    """mean(x) = plane + exp(-|x - x_i|^2 / 2) @ weights, shape (m,)."""
    mean: np.ndarray
    """Mean without the plane, shape (m,)."""
    variance: Callable[[], np.ndarray]
    """Shape (m,); takes twice as long as all the rest. Can be asked for once."""


class ExactProfiledLikelihood:
    """The likelihood of all samples, nothing approximated."""

    def __init__(self, samples: MergedSamples) -> None:
        self._samples = samples
        self._merged = bool((samples.root_count != 1.0).any())

    def evaluate(self, parameters: np.ndarray) -> Evaluation | None:
        """The likelihood at (log lengthscales, log rho) (D + 1,); None where rounding breaks it."""
        points = self._samples.inputs * np.exp(-parameters[:-1])
        evaluated = self._evaluate(parameters)
        if evaluated is None:
            return None
        best, kernel, factor, inside = evaluated
        return Evaluation(best, lambda: self._derivatives(points, kernel, factor, best, inside))

    def _evaluate(self, parameters: np.ndarray) -> tuple[Profile, np.ndarray, np.ndarray, Inside] | None:
        """Profile, unit covariance of the distinct inputs, Cholesky factor and whitened columns."""
        samples = self._samples
        points = samples.inputs * np.exp(-parameters[:-1])
        rho = float(np.exp(parameters[-1]))
        kernel = squared_exponential(points)
        factor = self._factor(kernel, rho)
        if factor is None:
            return None
        whitened = trtrs(factor, samples.columns, lower=1)[0]
        outside = np.zeros((samples.plane_rank + 1, samples.plane_rank + 1))
        outside[-1, -1] = samples.scatter
        gram = whitened.T @ whitened + outside / rho
        log_determinant = 2.0 * float(np.log(factor.diagonal()).sum())
        log_determinant += (samples.total - len(points)) * parameters[-1]
        best = profile(gram, log_determinant, samples.total)
        return best, kernel, factor, Inside(samples.total, rho, whitened, outside)

    def training_process(self, parameters: np.ndarray) -> TrainingProcess | None:
        """The trained process, at its own training inputs; None where rounding breaks it."""
        samples, root = self._samples, self._samples.root_count
        evaluated = self._evaluate(parameters)
        if evaluated is None:
            return None
        best, _, factor, inside = evaluated
        solved = trtrs(factor, inside.columns @ best.residual, lower=1, trans=1)[0]
        mean = (samples.columns @ best.residual - inside.rho * solved) / root

        def variance() -> np.ndarray:
            inverse = potri(factor, lower=1, overwrite_c=1)[0].diagonal()
            left = inside.rho * (1.0 - inside.rho * inverse) / root**2
            return best.scale * np.maximum(left, 0.0)

        return TrainingProcess(best, root * solved, mean, variance)

    def _factor(self, kernel: np.ndarray, rho: float) -> np.ndarray | None:
        root = self._samples.root_count
        inner = kernel * root[:, None] if self._merged else kernel.copy()
        if self._merged:
            inner *= root
        inner.ravel()[:: len(inner) + 1] += rho
        return cholesky(inner)

    def _derivatives(
        self, points: np.ndarray, kernel: np.ndarray, factor: np.ndarray, best: Profile, inside: Inside
    ) -> Derivatives:
        root = self._samples.root_count
        solved = trtrs(factor, inside.columns @ best.residual, lower=1, trans=1)[0]
        moved = root[:, None] * moved_by_lengthscales(kernel, points, root * solved)
        rows = trtrs(factor, np.column_stack([moved, inside.rho * solved]), lower=1)[0]
        return derivatives(best, inside, self._traces(points, kernel, factor, inside.rho), rows)

    def _traces(self, points: np.ndarray, kernel: np.ndarray, factor: np.ndarray, rho: float) -> np.ndarray:
        """trace((K + rho I)^-1 dK); overwrites ``factor`` with the inverse."""
        root = self._samples.root_count
        inverse = potri(factor, lower=1, overwrite_c=1)[0]
        by_noise = rho * float(inverse.diagonal().sum()) + self._samples.total - len(points)
        weighted = inverse.T
        weighted *= kernel
        ones = np.column_stack([root, root[:, None] * points])
        summed = root[:, None] * symm(1.0, weighted.T, ones, lower=1)
        return np.append(trace_by_lengthscales(summed[:, 0], summed[:, 1:], points), by_noise)
