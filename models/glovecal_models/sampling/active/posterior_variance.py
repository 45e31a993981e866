"""The variance of a process after samples, and how much it falls with more: both without any target.

With samples at X, whose errors have the covariance N, the variance at u is

    v(u) = k(u, u) - k(u, X) (K + N)^-1 k(X, u)

and further samples at C, of error covariance M, lower it by g (S + M)^-1 g', where g and S are the
covariances (after X) of u with C and of C with itself (Rasmussen & Williams 2006, equation 2.24; the mean of
the fall over many u is the criterion of Cohn 1996).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular

from glovecal_models.sampling.active.assumed_process import AssumedProcess
from glovecal_models.sampling.active.sampled_points import SampledPoints


class PosteriorVariance:
    """Of one rotation, at the points ``u`` (U, D + 1) where it will be used."""

    def __init__(self, process: AssumedProcess, u: np.ndarray, sampled: Sequence[SampledPoints]) -> None:
        self._process, self._u = process, u
        self._points = np.concatenate([np.empty((0, u.shape[1])), *(each.points for each in sampled)])
        self._lower = self._root([each.errors for each in sampled])
        self._white = self._whitened(u)
        self.variance = np.maximum(process.alone(u) - (self._white**2).sum(axis=0), 0.0)
        """At u, shape (U,), degrees squared, without the noise of a frame."""

    def fall(self, more: SampledPoints) -> np.ndarray:
        """By how much the variance at u falls, shape (U,), with ``more`` samples."""
        white = self._whitened(more.points)
        between = self._process.between(self._u, more.points) - self._white.T @ white
        inside = self._process.between(more.points, more.points) - white.T @ white + more.errors
        return np.einsum("um,mu->u", between, cho_solve(cho_factor(inside, lower=True), between.T))

    def _root(self, errors: Sequence[np.ndarray]) -> np.ndarray:
        """Lower root of K + N."""
        if not len(self._points):
            return np.empty((0, 0))
        matrix = self._process.between(self._points, self._points) + block_diag(*errors)
        return np.linalg.cholesky(matrix)

    def _whitened(self, points: np.ndarray) -> np.ndarray:
        if not len(self._points):
            return np.empty((0, len(points)))
        to_points = self._process.between(self._points, points)
        return solve_triangular(self._lower, to_points, lower=True, check_finite=False)
