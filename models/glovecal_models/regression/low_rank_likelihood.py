"""Low-rank approximations of the marginal likelihood, and how far from it they can be.

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
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.regression.lapack_routines import potrf, trmm, trsm, trtrs
from glovecal_models.regression.merged_samples import MergedSamples
from glovecal_models.regression.pivoted_cholesky import PivotedCholesky, pivoted_cholesky
from glovecal_models.regression.profiled_likelihood import (
    LOG_2_PI,
    Derivatives,
    Evaluation,
    Inside,
    Profile,
    cholesky,
    derivatives,
    moved_by_lengthscales,
    profile,
    squared_exponential,
    trace_by_lengthscales,
)


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
