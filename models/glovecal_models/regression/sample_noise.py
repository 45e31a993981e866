"""Samples whose noise is known in parts: a variance that the reference states for each, and what is left.

Noise of sample i: s^2 (g + v_i), v_i the stated variance, g what glove and model add on average, s^2 the
factor by which the stated variances are wrong (profiled out with the scale; 1 where they are right). g
follows from the errors of a fit that treats all samples alike: the mean square of errors less the mean
stated variance, as the moment estimator of DerSimonian & Laird (1986) has it for studies of unequal
precision.

Rows of the likelihood are multiplied by the root of their relative precision, as by the root of a count
(``merged_samples``): with a geometric mean of 1 the likelihood's value stays that of the samples themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel
from glovecal_models.regression.fast_lmc import finish_search
from glovecal_models.regression.linear_regressor import LinearRegressor, fit_linear
from glovecal_models.regression.lmc_search import LmcSearch
from glovecal_models.regression.process_regressor import ProcessRegressor

LEAST_OWN_SHARE = 0.05
"""Of the mean stated variance: what a glove adds at least, so that no single sample decides."""


@dataclass(frozen=True)
class SampleNoise:
    """Of N samples."""

    precision: np.ndarray
    """(N,), relative, with a geometric mean of 1."""
    own_variance: float
    """g, degrees squared."""
    own_precision: float
    """That a sample would have whose reference is exact."""

    def of_exact_reference(self, noise_variance: float) -> float:
        """The noise of a sample whose reference is exact, where one of precision 1 has ``noise_variance``."""
        return noise_variance / self.own_precision

    def evidence(self, noise_variance: float) -> dict[str, Any]:
        """``stated_variance_times``: s^2 above."""
        own = self.of_exact_reference(noise_variance)
        return {
            "stated_variance_times": own / self.own_variance,
            "own_noise_deg": float(np.sqrt(own)),
            "most_precise_over_least": float(self.precision.max() / self.precision.min()),
        }


def check_variance(variance: np.ndarray, samples: int) -> np.ndarray:
    """Stated variances (N,), degrees squared. Raises NotTrainable."""
    variance = np.asarray(variance, dtype=float)
    if variance.shape != (samples,) or not (np.isfinite(variance) & (variance >= 0)).all():
        raise NotTrainable(
            f"variances of the reference have shape {variance.shape}, expected ({samples},), finite and not "
            "negative"
        )
    return variance


def sample_noise(variance: np.ndarray, error: np.ndarray) -> SampleNoise | None:
    """From stated variances (N,) and the errors (N,) of a fit that treats all samples alike; None where all
    variances are equal, so that there is nothing to tell samples apart by."""
    mean = float(variance.mean())
    if np.ptp(variance) <= 1e-12 * mean:
        return None
    own = max(float(np.mean(error**2)) - mean, LEAST_OWN_SHARE * mean)
    logs = -np.log(own + variance)
    middle = float(logs.mean())
    return SampleNoise(np.exp(logs - middle), own, float(np.exp(-np.log(own) - middle)))


def with_stated_variance(
    process: ProcessRegressor,
    inputs: np.ndarray,
    target: np.ndarray,
    variance: np.ndarray,
    *,
    seed: int = 0,
    cancelled: Cancel | None = None,
) -> ProcessRegressor:
    """An LMC-GPR of ``inputs`` (N, D) and ``target`` (N,) anew, each sample with a variance (N,) of its own,
    degrees squared; ``process`` itself where all are equal.

    ``process``: trained on the same samples as if all were alike; the search begins at its optimum, and each
    sample counts as much. ``noise_variance`` becomes that of a sample whose reference is exact. Raises
    NotTrainable, Cancelled.
    """
    variance = check_variance(variance, len(target))
    noise = sample_noise(variance, process.predict(inputs).mean - target)
    if noise is None:
        return process
    search = LmcSearch.begin(
        inputs, target, sample_weight=process.evidence["sample_weight"], precision=noise.precision,
        start=process.evidence["optimum"], seed=seed, cancelled=cancelled,
    )  # fmt: skip
    found = finish_search(search, cancelled=cancelled)
    return replace(
        found,
        noise_variance=noise.of_exact_reference(found.noise_variance),
        evidence=found.evidence | noise.evidence(found.noise_variance),
    )


def fit_linear_with_variance(
    inputs: np.ndarray, target: np.ndarray, variance: np.ndarray | None, **options: Any
) -> LinearRegressor:
    """``fit_linear`` (its ``options``) by weighted least squares where variances (N,) are stated, degrees
    squared; ``noise_variance`` becomes that of a sample whose reference is exact."""
    alike = fit_linear(inputs, target, **options)
    if variance is None:
        return alike
    noise = sample_noise(check_variance(variance, len(target)), alike.predict(inputs).mean - target)
    if noise is None:
        return alike
    found = fit_linear(inputs, target, precision=noise.precision, **options)
    return replace(
        found,
        noise_variance=noise.of_exact_reference(found.noise_variance),
        evidence=found.evidence | noise.evidence(found.noise_variance),
    )
