"""Exact Gaussian-process regression with any mean and any covariance (Wang & Neff 2013, section 6.1).

The mean's coefficients are solved for at every step (``mean.profile_coefficients``); the covariance's
hyperparameters and the noise are searched with the analytic gradient. For the product's own LMC-GPR the
low-rank trainer reaches the same optimum much faster; this one serves every other combination, and as
the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from glovecal_models.covariance.base import Covariance
from glovecal_models.covariance.linear_ard import LinearArd
from glovecal_models.covariance.squared_exponential import SquaredExponentialArd
from glovecal_models.progress import Cancel, Report
from glovecal_models.regression.lapack_routines import ger, potrf, potri
from glovecal_models.regression.mean import LinearMean, Mean, profile_coefficients
from glovecal_models.regression.optimise import Optimum, counted_progress, minimise
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.regression.profiled_likelihood import LOG_2_PI
from glovecal_models.regression.training_samples import Standardised, check_samples, standardise

JITTER = 1e-8
"""Added to the covariance's diagonal, in units of the target's variance; stored with the model."""

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


def search_few(
    x: np.ndarray,
    y: np.ndarray,
    mean: Mean,
    covariance: Covariance,
    *,
    starts: int,
    generator: np.random.Generator,
    samples: int = 400,
    iterations: int = 200,
    cancelled: Cancel | None = None,
    on_evaluation: Callable[[int], None] | None = None,
) -> Optimum:
    """The best [theta, log noise variance] of several searches on at most ``samples`` random samples."""
    first = np.concatenate([covariance.initial(x, y), [np.log(0.05)]])
    others = [first + generator.normal(scale=1.2, size=len(first)) for _ in range(starts - 1)]
    chosen = generator.permutation(len(y))[:samples]
    return minimise(
        ExactLikelihood(x[chosen], y[chosen], mean, covariance),
        [first, *others],
        search_bounds(covariance, x.shape[1]),
        iterations=iterations,
        cancelled=cancelled,
        on_evaluation=on_evaluation,
    )


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
    search = search_few(
        working.x,
        working.y,
        mean,
        covariance,
        starts=starts,
        generator=np.random.default_rng(0),
        cancelled=cancelled,
        on_evaluation=counted_progress(report, f"searching from {starts} starts", 0.0, 0.2),
    )
    likelihood = ExactLikelihood(working.x, working.y, mean, covariance)
    optimum = minimise(
        likelihood,
        [search.parameters],
        search_bounds(covariance, working.x.shape[1]),
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
