"""The processes that are tried on hardware nobody knows (Wang & Neff 2013, section 8.1), and their training.

The paper names two roads for sensors that are not linear: a polynomial covariance in place of the linear term
of its model, and (m_0, k_seARD + k_seARD) for sensors of unknown properties.

Equal inputs are merged and samples may count for less than one, as in ``fit_lmc_gpr``; what is trained is
served on few nodes. ``fit_exact`` stays the reference that does none of this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.covariance.base import Covariance
from glovecal_models.covariance.functions import Polynomial, SquaredExponentialArd
from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel
from glovecal_models.regression.exact import JITTER, CountedLikelihood, search_bounds
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.linear_regressor import LinearMean, Mean, ZeroMean
from glovecal_models.regression.optimise import Optimum, minimise
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.served_nodes import few_nodes
from glovecal_models.regression.training_samples import (
    MergedSamples,
    Standardised,
    check_samples,
    standardise,
)

MEAN_ERROR_DEG, SD_ERROR_DEG = 1e-3, 2e-3
"""How closely served nodes follow the exact process at the training inputs."""
STARTS = 3
SEARCHED_SAMPLES = 250
"""Samples on which several starts are tried; the best goes on with all."""
FIRST_LOG_NOISE = float(np.log(0.05))


def _searched(
    working: Standardised, whole: CountedLikelihood, sample_weight: float, seed: int, cancelled: Cancel | None
) -> Optimum:
    """The best of several short searches on some of the samples; each start is fixed by the seed."""
    mean, covariance, generator = whole.mean, whole.covariance, np.random.default_rng(seed)
    first = np.append(covariance.initial(working.x, working.y), FIRST_LOG_NOISE)
    others = [first + generator.normal(scale=1.2, size=len(first)) for _ in range(STARTS - 1)]
    chosen = np.sort(generator.permutation(len(working.y))[:SEARCHED_SAMPLES])
    weight = min(1.0, sample_weight * len(working.y) / len(chosen))
    samples = MergedSamples.of(working.x[chosen], working.y[chosen], weight)
    return minimise(
        CountedLikelihood(samples, mean, covariance),
        [first, *others],
        search_bounds(covariance, working.x.shape[1]),
        iterations=60,
        least_gain=0.01,
        cancelled=cancelled,
    )


def _regressor(
    working: Standardised, likelihood: CountedLikelihood, optimum: Optimum, method: str, sample_weight: float
) -> ProcessRegressor:
    """The trained process in degrees."""
    covariance, theta, scale = likelihood.covariance, optimum.parameters[:-1], working.target_scale
    found = likelihood.posterior(optimum.parameters)
    served = few_nodes(
        covariance, theta, likelihood.samples.inputs, found,
        mean_error=MEAN_ERROR_DEG / scale, sd_error=SD_ERROR_DEG / scale,
    )  # fmt: skip
    slope, intercept = likelihood.mean.plane(found.coefficients, working.x.shape[1])
    return ProcessRegressor(
        method=method,
        input_shift=working.input_shift,
        input_scale=working.input_scale,
        slope=scale * slope,
        intercept=working.target_shift + scale * intercept,
        covariance=covariance,
        theta=covariance.scaled(theta, scale**2),
        nodes=served.nodes,
        weights=served.weights / scale,
        variance_root=served.variance_root / scale,
        noise_variance=float(np.exp(optimum.parameters[-1])) * scale**2,
        jitter=JITTER * scale**2,
        evidence={
            "trainer": "kernel_process",
            "samples": len(working.y),
            "sample_weight": sample_weight,
            "distinct_inputs": len(likelihood.samples.inputs),
            "nlml": optimum.value,
            "target_scale_deg": scale,
            "parameters": optimum.parameters.tolist(),
            "evaluations": optimum.evaluations,
            "served_nodes": len(served.nodes),
            "served_mean_error_deg": served.mean_error * scale,
            "served_sd_error_deg": served.sd_error * scale,
        },
    )


LMC = "lmc_gpr"
AUTO, POLYNOMIAL, GENERAL = "auto", "polynomial_gpr", "general_gpr"
CHOOSING = (AUTO, POLYNOMIAL, GENERAL)
"""Training methods that take one of the candidates for each rotation."""


@dataclass(frozen=True)
class KernelCandidate:
    """A mean and a covariance that may serve a rotation."""

    name: str
    words: str
    """What it is, as a sentence about a sensor names it."""
    method: str
    """The training method that tries it besides ``auto``, and the regressor's method."""
    mean: Mean
    covariance: Covariance

    def parameters(self, dimensions: int) -> int:
        """How many numbers maximise the likelihood for ``dimensions`` inputs: mean, covariance, noise."""
        of_mean = self.mean.basis(np.zeros((1, dimensions))).shape[1]
        return of_mean + len(self.covariance.parameter_names(dimensions)) + 1

    def fit(
        self,
        inputs: np.ndarray,
        target: np.ndarray,
        *,
        sample_weight: float = 1.0,
        start: Sequence[float] | np.ndarray | None = None,
        iterations: int = 60,
        seed: int = 0,
        cancelled: Cancel | None = None,
    ) -> ProcessRegressor:
        """Train on raw inputs (N, D), counts, and target (N,), degrees; each sample counts ``sample_weight``.

        ``start`` (working units, as ``evidence["parameters"]`` of an earlier fit) replaces the search from
        several starts; LMC-GPR has a search of its own. ``evidence``: ``nlml`` in standardised units (+ N log
        target_scale_deg in degrees), ``parameters`` [theta, log noise variance]. Raises NotTrainable,
        Cancelled.
        """
        if self.name == LMC:
            return fit_lmc_gpr(inputs, target, sample_weight=sample_weight, seed=seed, cancelled=cancelled)
        working = standardise(*check_samples(inputs, target))
        samples = MergedSamples.of(working.x, working.y, sample_weight)
        likelihood = CountedLikelihood(samples, self.mean, self.covariance)
        try:
            if start is None:
                start = _searched(working, likelihood, sample_weight, seed, cancelled).parameters
            optimum = minimise(
                likelihood,
                [np.asarray(start, float)],
                search_bounds(self.covariance, working.x.shape[1]),
                iterations=iterations,
                least_gain=1e-3,
                cancelled=cancelled,
            )
        except np.linalg.LinAlgError:
            raise NotTrainable(
                f"{self.covariance!r} has no likelihood on these {len(target)} samples: its covariance"
                " matrix cannot be factorised"
            ) from None
        return _regressor(working, likelihood, optimum, self.method, sample_weight)


def _smooth() -> SquaredExponentialArd:
    return SquaredExponentialArd()


CANDIDATES = (
    KernelCandidate(LMC, "LMC-GPR", LMC, LinearMean(), _smooth()),
    KernelCandidate("polynomial_2", "a polynomial of degree 2", POLYNOMIAL, LinearMean(), Polynomial(2)),
    KernelCandidate("polynomial_3", "a polynomial of degree 3", POLYNOMIAL, LinearMean(), Polynomial(3)),
    KernelCandidate(
        "polynomial_3_smooth",
        "a polynomial of degree 3 with a smooth remainder",
        POLYNOMIAL,
        LinearMean(),
        Polynomial(3) + _smooth(),
    ),
    KernelCandidate(
        "general",
        "a general smooth map (two squared exponentials)",
        GENERAL,
        ZeroMean(),
        _smooth() + _smooth(),
    ),
)
"""The default first, then from the simplest to the most general: of equals the earlier one is taken."""

CANDIDATE = {item.name: item for item in CANDIDATES}


def candidates_of(method: str) -> tuple[KernelCandidate, ...]:
    """Those a training method tries: all for ``auto``, else those of the method's own."""
    return CANDIDATES if method == AUTO else tuple(item for item in CANDIDATES if item.method == method)
