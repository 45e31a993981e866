"""Exact Gaussian-process regression with any mean and any covariance (Wang & Neff 2013, section 6.1).

The mean's coefficients are solved for at every step (``mean.profile_coefficients``); the covariance's
hyperparameters and the noise are searched with the analytic gradient. For the product's own LMC-GPR the
low-rank trainer reaches the same optimum much faster; this one serves every other combination, and as
the reference.

The exact likelihood of any process on merged and weighted samples (``merged_samples``).

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
from glovecal_models.covariance.functions import LinearArd, SquaredExponentialArd
from glovecal_models.progress import Cancel, Report
from glovecal_models.regression.factorisation import ger, potrf, potri
from glovecal_models.regression.linear_regressor import LinearMean, Mean, profile_coefficients
from glovecal_models.regression.optimise import Optimum, counted_progress, minimise
from glovecal_models.regression.profiled_likelihood import LOG_2_PI
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.training_samples import (
    MergedSamples,
    Standardised,
    check_samples,
    standardise,
)

JITTER = 1e-8
"""Added to the covariance's diagonal, in units of the target's variance; stored with the model."""

SEARCHED = 400
"""Samples on which several starts are tried; the best goes on with all."""
LOG_NOISE_BOUNDS = (np.log(1e-6), np.log(10.0))
"""Range of the noise variance, in units of the target's variance."""


@dataclass(frozen=True)
class ExactLikelihood:
    """The negative log marginal likelihood of x (N, D), y (N,), over [theta, log noise variance]."""

    x: np.ndarray
    y: np.ndarray
    mean: Mean
    covariance: Covariance
    jitter: float = JITTER

    def __call__(self, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        """Value (equation 11) and gradient (equation 12) at the best mean coefficients.

        Raises LinAlgError where the matrix is not positive definite.
        """
        theta, noise = parameters[:-1], float(np.exp(parameters[-1]))
        values, pullback = self.covariance.with_pullback(theta, self.x, self.x)
        lower = self.cholesky(values, noise)
        log_determinant = 2 * float(np.log(np.diagonal(lower)).sum())
        _, residual = self.fit_mean(lower)
        alpha = cho_solve((lower, True), residual, check_finite=False)
        value = 0.5 * (float(residual @ alpha) + log_determinant + len(self.y) * LOG_2_PI)
        weights = _likelihood_weights(lower, alpha)
        by_theta, _ = pullback(weights)
        return value, np.concatenate([by_theta, [noise * float(np.trace(weights))]])

    def value(self, parameters: np.ndarray) -> float:
        """The value alone, a third of the work; raises LinAlgError."""
        lower = self.cholesky(self.covariance(parameters[:-1], self.x, self.x), float(np.exp(parameters[-1])))
        _, residual = self.fit_mean(lower)
        white = solve_triangular(lower, residual, lower=True, check_finite=False)
        log_determinant = 2 * float(np.log(np.diagonal(lower)).sum())
        return 0.5 * (float(white @ white) + log_determinant + len(self.y) * LOG_2_PI)

    def cholesky(self, values: np.ndarray, noise: float) -> np.ndarray:
        """Lower root of values + (noise + jitter) I, column-major, zeros above; values stay unchanged."""
        matrix = values.T.copy(order="F")
        matrix.ravel(order="K")[:: len(matrix) + 1] += noise + self.jitter
        lower, failed = potrf(matrix, lower=1, clean=1, overwrite_a=1)
        if failed:
            raise np.linalg.LinAlgError("the covariance matrix is not positive definite")
        return lower

    def fit_mean(self, lower: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The mean's best coefficients (C,) and the residual target (N,)."""
        basis = self.mean.basis(self.x)
        both = np.column_stack([basis, self.y])
        white = solve_triangular(lower, both, lower=True, check_finite=False)
        coefficients = profile_coefficients(white[:, :-1], white[:, -1])
        return coefficients, self.y - basis @ coefficients


def _likelihood_weights(lower: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """A matrix G with sum(G * dK) the change of the likelihood for every symmetric dK; consumes ``lower``.

    G = (K^-1 - alpha alpha^T) / 2, but with K^-1 as its lower triangle, doubled: the factorisation gives
    just that triangle, and filling the other would only move memory.
    """
    inverse, failed = potri(lower, lower=1, overwrite_c=1)
    if failed:
        raise np.linalg.LinAlgError("the covariance matrix is not positive definite")
    inverse.ravel(order="K")[:: len(inverse) + 1] *= 0.5
    return ger(-0.5, alpha, alpha, a=inverse, overwrite_a=1).T


def search_bounds(covariance: Covariance, dimensions: int) -> list[tuple[float, float]]:
    """Of [theta, log noise variance], in working units."""
    return [*covariance.bounds(dimensions), LOG_NOISE_BOUNDS]


def fit_exact(
    inputs: np.ndarray,
    target: np.ndarray,
    mean: Mean,
    covariance: Covariance,
    *,
    starts: int = 4,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> ProcessRegressor:
    """Train on raw inputs (N, D), counts, and target (N,), degrees.

    ``starts`` searches run on at most 400 of the samples, the best goes on with all. Raises NotTrainable
    for samples that cannot carry a model, Cancelled when ``cancelled`` says so. ``evidence`` holds the
    NLML in standardised units (add N log target_scale_deg for degrees), and what each start reached.
    """
    working = standardise(*check_samples(inputs, target))
    generator, bounds = np.random.default_rng(0), search_bounds(covariance, working.x.shape[1])
    first = np.append(covariance.initial(working.x, working.y), np.log(0.05))
    others = [first + generator.normal(scale=1.2, size=len(first)) for _ in range(starts - 1)]
    chosen = generator.permutation(len(target))[:SEARCHED]
    search = minimise(
        ExactLikelihood(working.x[chosen], working.y[chosen], mean, covariance),
        [first, *others],
        bounds,
        cancelled=cancelled,
        on_evaluation=counted_progress(report, f"searching from {starts} starts", 0.0, 0.2),
    )
    likelihood = ExactLikelihood(working.x, working.y, mean, covariance)
    optimum = minimise(
        likelihood,
        [search.parameters],
        bounds,
        cancelled=cancelled,
        on_evaluation=counted_progress(report, f"fitting {len(target)} samples", 0.2, 1.0),
    )
    return _regressor(working, likelihood, optimum, search)


def _regressor(
    working: Standardised, likelihood: ExactLikelihood, optimum: Optimum, search: Optimum
) -> ProcessRegressor:
    """The trained process in degrees."""
    theta, noise = optimum.parameters[:-1], float(np.exp(optimum.parameters[-1]))
    lower = likelihood.cholesky(likelihood.covariance(theta, working.x, working.x), noise)
    coefficients, residual = likelihood.fit_mean(lower)
    slope, intercept = likelihood.mean.plane(coefficients, working.x.shape[1])
    scale, samples = working.target_scale, len(working.y)
    root = solve_triangular(lower, np.eye(samples), lower=True, check_finite=False).T
    return ProcessRegressor(
        method=_method(likelihood.mean, likelihood.covariance),
        input_shift=working.input_shift,
        input_scale=working.input_scale,
        slope=scale * slope,
        intercept=working.target_shift + scale * intercept,
        covariance=likelihood.covariance,
        theta=likelihood.covariance.scaled(theta, scale**2),
        nodes=working.x,
        weights=cho_solve((lower, True), residual, check_finite=False) / scale,
        variance_root=root / scale,
        noise_variance=noise * scale**2,
        jitter=likelihood.jitter * scale**2,
        evidence={
            "trainer": "exact",
            "samples": samples,
            "nlml": optimum.value,
            "target_scale_deg": scale,
            "evaluations": optimum.evaluations,
            "search_evaluations": search.evaluations,
            "start_values": search.start_values,
        },
    )


def _method(mean: Mean, covariance: Covariance) -> str:
    """``lmc_gpr`` for the paper's model, with or without the term a linear mean makes redundant."""
    kinds = sorted(part.kind for part in covariance.parts())
    paper = [[SquaredExponentialArd.kind], sorted([LinearArd.kind, SquaredExponentialArd.kind])]
    return "lmc_gpr" if isinstance(mean, LinearMean) and kinds in paper else "gpr"


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
