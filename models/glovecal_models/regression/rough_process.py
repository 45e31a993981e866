"""An LMC-GPR good enough to compare settings by its errors: lengthscales and noise from some of the samples.

The search takes 800 samples at most, where an exact evaluation costs a tenth of one with 2000; plane, scale
and mean are those of all samples. No nodes are chosen and nothing is certified: it is never served.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glovecal_models.covariance.squared_exponential_ard import SquaredExponentialArd
from glovecal_models.errors import NotTrainable
from glovecal_models.regression.exact_profiled_likelihood import ExactProfiledLikelihood, TrainingProcess
from glovecal_models.regression.lmc_search import MOST_EXACT
from glovecal_models.regression.merged_samples import MergedSamples
from glovecal_models.regression.multi_start import SCREENED, search_exactly, some_samples
from glovecal_models.regression.standardise import Standardised, standardise
from glovecal_models.regression.training_check import check_samples

LEAST_SEARCHED = 500
TOLERANCE = 0.05
"""Nats that one more step of the search may still promise."""


@dataclass(frozen=True)
class RoughProcess:
    """A process that predicts a mean, and tells how flexible it is."""

    parameters: np.ndarray
    """Log lengthscales and log noise-to-signal ratio (D + 1,), standardised units."""
    _standard: Standardised
    _samples: MergedSamples
    _process: TrainingProcess

    def mean(self, inputs: np.ndarray) -> np.ndarray:
        """Degrees (N,), at raw inputs (N, D)."""
        x = (inputs - self._standard.input_shift) / self._standard.input_scale
        plane = self._samples.to_plane @ self._process.profile.plane
        theta = np.append(0.0, -2.0 * self.parameters[:-1])
        smooth = SquaredExponentialArd()(theta, x, self._samples.inputs) @ self._process.weights
        return self._standard.target_shift + self._standard.target_scale * (
            x @ plane[:-1] + plane[-1] + smooth
        )

    def degrees_of_freedom(self) -> float:
        """Sum over its samples, as they count, of variance over noise variance, 1 at most. Ask once."""
        noise = float(np.exp(self.parameters[-1])) * self._process.profile.scale
        share = np.minimum(self._process.variance() / max(noise, 1e-300), 1.0)
        return float(share @ self._samples.root_count**2)


def fit_roughly(
    inputs: np.ndarray,
    target: np.ndarray,
    *,
    start: np.ndarray,
    sample_weight: float = 1.0,
    seed: int = 0,
    cancelled: Callable[[], bool] | None = None,
) -> RoughProcess:
    """Of ``inputs`` (N, D), raw counts, and ``target`` (N,), degrees, each sample counting ``sample_weight``.

    ``start``: parameters near the optimum, as ``LmcSearch.found`` has them for more samples of the same
    weight. Raises NotTrainable, Cancelled.
    """
    standard = standardise(*check_samples(inputs, target))
    samples = MergedSamples.of(standard.x, standard.y, sample_weight)
    generator = np.random.default_rng(seed)
    if len(samples.inputs) > MOST_EXACT:
        samples = some_samples(standard.x, standard.y, MOST_EXACT // 2, generator, sample_weight)
    # as few as count whole ones together: fewer would have to count for more than one each
    searched = int(np.clip(np.ceil(sample_weight * len(target)), LEAST_SEARCHED, SCREENED))
    subset = some_samples(standard.x, standard.y, searched, generator, sample_weight)
    optimum = search_exactly(subset, start, tolerance=TOLERANCE, cancelled=cancelled)
    parameters = start if optimum is None else optimum.parameters
    process = ExactProfiledLikelihood(samples).training_process(parameters)
    if process is None:
        raise NotTrainable(f"no process of these {len(target)} samples can be computed at {parameters}")
    return RoughProcess(parameters, standard, samples, process)
