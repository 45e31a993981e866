"""The marginal likelihood at a cost that does not depend on the number of samples.

Nodes are chosen once by pivoted Cholesky at shorter lengthscales than those to be searched. Functions of
the longer lengthscales are then interpolated from the nodes by weights W (N, r) that do not depend on the
hyperparameters: K(theta) ~ W Kzz(theta) W'. With one QR factorisation [S W, columns] = Q R each evaluation
needs only r x r matrices: P Kzz P' + rho I, P the triangular corner of R. Kin: structured kernel
interpolation (Wilson & Nickisch 2015), but on r well-chosen nodes in place of a grid, and the fixed basis
of Solin & Sarkka (2020), but for any inputs.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.regression.lapack_routines import potrf, trmm, trtrs
from glovecal_models.regression.merged_samples import MergedSamples
from glovecal_models.regression.pivoted_cholesky import PivotedCholesky, pivoted_cholesky
from glovecal_models.regression.profiled_likelihood import (
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
        weights = trtrs(factor.corner().T, factor.rows, lower=0)[0].T
        triangle = _triangle(np.column_stack([weights * samples.root_count[:, None], samples.columns]))
        r = self.rank
        self._corner = np.asfortranarray(triangle[:r, :r])
        self._columns = triangle[:r, r:]
        self._outside = triangle[r:, r:].T @ triangle[r:, r:]
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


def _triangle(tall: np.ndarray) -> np.ndarray:
    """R of tall = Q R, (c, c). By Cholesky of the Gram matrix where that is safe: three times faster."""
    gram = tall.T @ tall
    factor, info = potrf(gram, lower=0, clean=1)
    if info == 0 and factor.diagonal().min() > 1e-5 * factor.diagonal().max():
        return factor
    r = np.asarray(np.linalg.qr(tall, mode="r"))
    missing = tall.shape[1] - len(r)
    return np.vstack([r, np.zeros((missing, tall.shape[1]))]) if missing > 0 else r
