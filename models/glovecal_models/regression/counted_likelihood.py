"""The exact likelihood of any process on merged and weighted samples (``merged_samples``).

A sample that counts c has its likelihood to the power c. With noise variance s^2 that is one observation
with noise s^2 / c, and a factor that depends on s^2 alone: (c - 1) / 2 log(2 pi s^2) + 1 / 2 log c in the
negative logarithm, and the scatter of merged samples over 2 s^2. The values therefore stand beside those of
``fit_lmc_gpr`` for the same samples with the same weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from glovecal_models.covariance.base import Covariance
from glovecal_models.regression.exact import JITTER
from glovecal_models.regression.lapack_routines import potrf, potri
from glovecal_models.regression.mean import Mean, profile_coefficients
from glovecal_models.regression.merged_samples import MergedSamples
from glovecal_models.regression.profiled_likelihood import LOG_2_PI


@dataclass(frozen=True)
class Posterior:
    """A process at fixed hyperparameters: what prediction is made of. m distinct inputs."""

    coefficients: np.ndarray
    """Of the mean's basis, (C,)."""
    residual: np.ndarray
    """Mean target of each input without the mean, (m,)."""
    noise: np.ndarray
    """Noise variance of each input's mean target, jitter included, (m,)."""
    lower: np.ndarray
    """Cholesky factor of K + diag(noise), (m, m)."""
    weights: np.ndarray
    """(K + diag(noise))^-1 residual, (m,)."""


@dataclass(frozen=True)
class CountedLikelihood:
    """NLML over [theta, log noise variance], working units."""

    samples: MergedSamples
    mean: Mean
    covariance: Covariance
    jitter: float = JITTER

    def __call__(self, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        """Value and gradient at the best mean coefficients. Raises LinAlgError."""
        x, counts, noise = self.samples.inputs, self.counts, float(np.exp(parameters[-1]))
        values, pullback = self.covariance.with_pullback(parameters[:-1], x, x)
        found = self._posterior(values, noise)
        log_determinant = 2 * float(np.log(np.diagonal(found.lower)).sum())
        value = 0.5 * (float(found.residual @ found.weights) + log_determinant + len(x) * LOG_2_PI)
        value += 0.5 * float(((counts - 1) * (LOG_2_PI + np.log(noise)) + np.log(counts)).sum())
        value += 0.5 * self.samples.scatter / noise
        weights = 0.5 * (_inverse(found.lower) - np.outer(found.weights, found.weights))
        by_noise = noise * float(np.diagonal(weights) @ (1 / counts))
        by_noise += 0.5 * float((counts - 1).sum()) - 0.5 * self.samples.scatter / noise
        return value, np.append(pullback(weights)[0], by_noise)

    @property
    def counts(self) -> np.ndarray:
        """What the samples at each distinct input count, (m,)."""
        return self.samples.root_count**2

    def posterior(self, parameters: np.ndarray) -> Posterior:
        """Raises LinAlgError."""
        x = self.samples.inputs
        return self._posterior(self.covariance(parameters[:-1], x, x), float(np.exp(parameters[-1])))

    def _posterior(self, values: np.ndarray, noise: float) -> Posterior:
        diagonal = noise / self.counts + self.jitter
        lower, failed = potrf(values + np.diag(diagonal), lower=1, clean=1)
        if failed:
            raise np.linalg.LinAlgError("the covariance matrix is not positive definite")
        target = self.samples.columns[:, -1] / self.samples.root_count
        basis = self.mean.basis(self.samples.inputs)
        white = solve_triangular(lower, np.column_stack([basis, target]), lower=True, check_finite=False)
        coefficients = profile_coefficients(white[:, :-1], white[:, -1])
        residual = target - basis @ coefficients
        weights = cho_solve((lower, True), residual, check_finite=False)
        return Posterior(coefficients, residual, diagonal, lower, weights)


def _inverse(lower: np.ndarray) -> np.ndarray:
    half, failed = potri(lower, lower=1)
    if failed:
        raise np.linalg.LinAlgError("the covariance matrix is not positive definite")
    half = np.tril(half)
    return half + np.tril(half, -1).T
