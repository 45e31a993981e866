"""Training a process with any mean and covariance as the product serves it.

Equal inputs are merged and samples may count for less than one, as in ``fit_lmc_gpr``; what is trained is
served on few nodes. ``fit_exact`` stays the reference that does none of this.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from glovecal_models.covariance.base import Covariance
from glovecal_models.errors import NotTrainable
from glovecal_models.regression.counted_likelihood import CountedLikelihood
from glovecal_models.regression.exact import JITTER, search_bounds
from glovecal_models.regression.few_nodes import few_nodes
from glovecal_models.regression.mean import Mean
from glovecal_models.regression.merged_samples import MergedSamples
from glovecal_models.regression.optimise import Optimum, minimise
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.regression.standardise import Standardised, standardise
from glovecal_models.regression.training_check import check_samples

MEAN_ERROR_DEG, SD_ERROR_DEG = 1e-3, 2e-3
"""How closely served nodes follow the exact process at the training inputs."""
SEARCHED = 250
"""Samples on which several starts are tried; the best goes on with all."""
FIRST_LOG_NOISE = float(np.log(0.05))


def fit_process(
    inputs: np.ndarray,
    target: np.ndarray,
    mean: Mean,
    covariance: Covariance,
    method: str,
    *,
    sample_weight: float = 1.0,
    start: Sequence[float] | np.ndarray | None = None,
    starts: int = 3,
    iterations: int = 60,
    seed: int = 0,
    cancelled: Callable[[], bool] | None = None,
) -> ProcessRegressor:
    """Train on raw inputs (N, D), counts, and target (N,), degrees; each sample counts ``sample_weight``.

    ``start`` (working units, as ``evidence["parameters"]`` of an earlier fit) replaces the search from
    several starts. ``evidence``: ``nlml`` in standardised units (+ N log target_scale_deg in degrees),
    ``parameters`` [theta, log noise variance]. Raises NotTrainable, Cancelled.
    """
    working = standardise(*check_samples(inputs, target))
    samples = MergedSamples.of(working.x, working.y, sample_weight)
    likelihood = CountedLikelihood(samples, mean, covariance)
    try:
        if start is None:
            start = _searched(working, mean, covariance, sample_weight, starts, seed, cancelled).parameters
        optimum = minimise(
            likelihood,
            [np.asarray(start, float)],
            search_bounds(covariance, working.x.shape[1]),
            iterations=iterations,
            least_gain=1e-3,
            cancelled=cancelled,
        )
    except np.linalg.LinAlgError as error:
        raise NotTrainable(
            f"{covariance!r} has no likelihood on these {len(target)} samples: {error}"
        ) from None
    return _regressor(working, likelihood, optimum, method, sample_weight)


def _searched(
    working: Standardised,
    mean: Mean,
    covariance: Covariance,
    sample_weight: float,
    starts: int,
    seed: int,
    cancelled: Callable[[], bool] | None,
) -> Optimum:
    """The best of several short searches on some of the samples; each start is fixed by the seed."""
    generator = np.random.default_rng(seed)
    first = np.append(covariance.initial(working.x, working.y), FIRST_LOG_NOISE)
    others = [first + generator.normal(scale=1.2, size=len(first)) for _ in range(starts - 1)]
    chosen = np.sort(generator.permutation(len(working.y))[:SEARCHED])
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
