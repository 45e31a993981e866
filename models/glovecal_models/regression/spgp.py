"""SPGP: a sparse process whose pseudo-inputs and hyperparameters are trained together.

Snelson & Ghahramani (2006), as in Wang & Neff (2013), section 6.2, equations 15 to 19, with a linear mean
(whose coefficients are solved for at every step) and, unlike equation 19, that mean in the prediction.
Pseudo-inputs start at the samples the process itself finds hardest to explain.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import eigh, solve_triangular

from glovecal_models.covariance.base import Covariance
from glovecal_models.errors import BadInput
from glovecal_models.progress import Cancel, Report
from glovecal_models.regression.exact import LOG_NOISE_BOUNDS
from glovecal_models.regression.factorisation import factor_by_rows
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.fitc import LEAST_NOISE, FitcLikelihood, Verdict, judge
from glovecal_models.regression.linear_regressor import LinearMean
from glovecal_models.regression.optimise import Optimum, counted_progress, minimise
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.training_samples import Standardised, check_samples, standardise

LEAST_GAIN = 1e-4
"""Nats of an iteration, below which the search ends."""
_START_SHARE = 0.2
_REACH = 1.0
"""How far beyond the samples a pseudo-input may move, in input deviations."""


def fit_spgp(
    inputs: np.ndarray,
    target: np.ndarray,
    *,
    pseudo_inputs: int = 100,
    iterations: int = 200,
    start: ProcessRegressor | None = None,
    sample_weight: float = 1.0,
    seed: int = 0,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> ProcessRegressor:
    """Train on raw inputs (N, D), counts, and target (N,), degrees.

    The search takes at most ``iterations`` iterations and ends earlier when one gains less than
    ``LEAST_GAIN``. It starts at the hyperparameters of ``start``, a process trained on the same
    samples, with pseudo-inputs chosen for these; without one at ``fit_lmc_gpr`` of the same samples. The
    noise may not fall below half the start's, and hyperparameters that the exact likelihood refuses are
    replaced by the start's (``fitc.judge``); ``evidence`` says which happened, its NLML values are in
    standardised units. The mean is linear, the covariance the start's. Each sample counts ``sample_weight``,
    at most 1, as in ``fit_lmc_gpr``. Raises NotTrainable, Cancelled, and BadInput when ``start`` has another
    sensor count.
    """
    inputs, target = check_samples(inputs, target)
    if pseudo_inputs < 1:
        raise BadInput(f"pseudo_inputs is {pseudo_inputs}, expected at least 1")
    if start is None:
        first_part = report and (lambda sentence, fraction: report(sentence, _START_SHARE * fraction))
        start = fit_lmc_gpr(
            inputs, target, sample_weight=sample_weight, seed=seed, cancelled=cancelled, report=first_part
        )
    if len(start.input_shift) != inputs.shape[1]:
        raise BadInput(f"the start has {len(start.input_shift)} sensors, the samples have {inputs.shape[1]}")
    generator, covariance = np.random.default_rng(seed), start.covariance
    working = _in_units_of(start, standardise(inputs, target))
    theta = covariance.scaled(start.theta, working.target_scale**-2)
    noise = start.noise_variance / working.target_scale**2
    noise = float(np.clip(noise, *np.exp(LOG_NOISE_BOUNDS)))
    likelihood = FitcLikelihood(working.x, working.y, LinearMean(), covariance, sample_weight=sample_weight)
    z = choose_pseudo_inputs(covariance, theta, working.x, pseudo_inputs, generator)
    first = likelihood.pack(theta, noise, z)
    on_evaluation = counted_progress(
        report, f"moving pseudo-inputs of {len(target)} samples", _START_SHARE, 1.0
    )
    optimum = minimise(
        likelihood,
        [first],
        _bounds(covariance, noise, working.x, len(first)),
        iterations=iterations,
        least_gain=LEAST_GAIN,
        cancelled=cancelled,
        on_evaluation=on_evaluation,
    )
    verdict = judge(likelihood, optimum.parameters, first, generator)
    if report is not None:
        report(verdict.sentence(), 1.0)
    evidence = _evidence(working, likelihood, first, optimum, verdict)
    return _regressor(working, likelihood, optimum.parameters if verdict.accepted else first, evidence)


def _in_units_of(start: ProcessRegressor, working: Standardised) -> Standardised:
    """The samples in the start's units of input, in which its theta holds."""
    inputs = working.input_shift + working.input_scale * working.x
    x = (inputs - start.input_shift) / start.input_scale
    return replace(working, x=x, input_shift=start.input_shift, input_scale=start.input_scale)


def _bounds(
    covariance: Covariance, noise: float, x: np.ndarray, parameters: int
) -> list[tuple[float, float]]:
    """Hyperparameters as in exact training but with the noise guarded; pseudo-inputs near the samples."""
    hyperparameters = covariance.bounds(x.shape[1])
    lowest = max(np.log(LEAST_NOISE * noise), LOG_NOISE_BOUNDS[0])
    reach = _REACH * x.std(axis=0)
    box = list(zip((x.min(axis=0) - reach).tolist(), (x.max(axis=0) + reach).tolist(), strict=True))
    count = (parameters - len(hyperparameters) - 1) // x.shape[1]
    return [*hyperparameters, (lowest, LOG_NOISE_BOUNDS[1]), *(box * count)]


def _evidence(
    working: Standardised, likelihood: FitcLikelihood, first: np.ndarray, optimum: Optimum, verdict: Verdict
) -> dict[str, Any]:
    variance = working.target_scale**2
    _, noise_start, z = likelihood.unpack(first)
    _, noise_trained, _ = likelihood.unpack(optimum.parameters)
    return {
        "trainer": "spgp",
        "samples": len(working.y),
        "sample_weight": likelihood.sample_weight,
        "pseudo_inputs": len(z),
        "evaluations": optimum.evaluations,
        "fitc_nlml_trained": optimum.value,
        "target_scale_deg": working.target_scale,
        "noise_variance_start": noise_start * variance,
        "noise_variance_trained": noise_trained * variance,
        "guard": {
            "accepted": verdict.accepted,
            "loss_per_sample": verdict.loss_per_sample,
            "samples": verdict.samples,
            "sentence": verdict.sentence(),
        },
    }


def _regressor(
    working: Standardised, likelihood: FitcLikelihood, parameters: np.ndarray, evidence: dict[str, Any]
) -> ProcessRegressor:
    """The trained process in degrees: weights Q^-1 Kmn Lambda^-1 (y - mean), root of Kmm^-1 - Q^-1."""
    theta, noise, z = likelihood.unpack(parameters)
    state = likelihood.state(theta, noise, z)
    slope, intercept = likelihood.mean.plane(state.coefficients, working.x.shape[1])
    scale = working.target_scale
    eigenvalues, vectors = eigh(state.inner)
    explained = vectors * np.sqrt(np.maximum(1.0 - 1.0 / np.maximum(eigenvalues, 1.0), 0.0))
    both = np.column_stack([explained, state.projected])
    both = solve_triangular(state.root.T, both, lower=False)
    return ProcessRegressor(
        method="spgp",
        input_shift=working.input_shift,
        input_scale=working.input_scale,
        slope=scale * slope,
        intercept=working.target_shift + scale * intercept,
        covariance=likelihood.covariance,
        theta=likelihood.covariance.scaled(theta, scale**2),
        nodes=z.copy(),
        weights=both[:, -1] / scale,
        variance_root=both[:, :-1] / scale,
        noise_variance=noise * scale**2,
        jitter=likelihood.jitter * scale**2,
        evidence=evidence | {"fitc_nlml": state.value},
    )


_EXPLAINED = 1e-9
"""A sample whose remaining variance is below this part of the largest prior variance needs no node."""


def choose_pseudo_inputs(
    covariance: Covariance, theta: np.ndarray, x: np.ndarray, count: int, generator: np.random.Generator
) -> np.ndarray:
    """At most ``count`` different rows of x (N, D): pivoted Cholesky of k(x, x), then random rows.

    The next row is the one the rows so far explain worst. Once all are explained the rest is drawn at
    random, since training changes the hyperparameters. Fewer come back only if x has fewer different rows.
    """
    distinct = np.unique(x, axis=0)
    count = min(count, len(distinct))
    diagonal = covariance.diagonal(theta, distinct)
    chosen = factor_by_rows(
        lambda pivot: covariance(theta, distinct[pivot : pivot + 1], distinct)[0],
        diagonal,
        _EXPLAINED * float(diagonal.max()),
        count,
    ).pivots
    left = np.setdiff1d(np.arange(len(distinct)), chosen)
    drawn = generator.permutation(left)[: count - len(chosen)]
    return distinct[np.concatenate([chosen, drawn])]
