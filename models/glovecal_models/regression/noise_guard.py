"""The guard against SPGP's noise collapse.

With free pseudo-inputs FITC can explain scatter by its own diagonal and drive the noise to nearly zero
(Bauer, van der Wilk & Rasmussen 2016), most of all when the rotation depends on something no sensor
reads. Its objective then looks better than the exact process's best, while the exact likelihood at its
hyperparameters is far worse. So the exact likelihood of some samples has the last word.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.regression.exact import ExactLikelihood
from glovecal_models.regression.fitc import FitcLikelihood

LEAST_NOISE = 0.5
"""Lower bound of the noise variance in the search, as a part of the start's. Estimates from 100 samples
scatter by 15 %, from 2000 by 3 %: half is outside either."""

TOLERATED_LOSS = 0.02
"""Nats per sample by which the exact likelihood may be worse than at the start. A noise variance 25 % too
low costs as much; sparse training of well-posed rotations costs a tenth of it."""

_MOST, _LEAST = 500, 100
"""Samples the exact likelihood is taken of: as many as they count for, within these."""


@dataclass(frozen=True)
class Verdict:
    """What the guard found."""

    accepted: bool
    loss_per_sample: float
    """Exact negative log likelihood at the trained hyperparameters less that at the start's, nats."""
    samples: int

    def sentence(self) -> str:
        if self.accepted:
            return "trained hyperparameters kept: the exact likelihood confirms them"
        return (
            f"trained hyperparameters refused: their exact likelihood is {self.loss_per_sample:.3g} nats per "
            "sample worse than the start's (noise collapse); the start's are kept. The rotation may depend "
            "on something its sensors do not read."
        )


def judge(
    likelihood: FitcLikelihood, trained: np.ndarray, start: np.ndarray, generator: np.random.Generator
) -> Verdict:
    """Compare two parameter vectors of ``likelihood`` by the exact likelihood of up to 500 samples."""
    worth = int(likelihood.sample_weight * len(likelihood.y))
    chosen = generator.permutation(len(likelihood.y))[: max(_LEAST, min(_MOST, worth))]
    x, y = likelihood.x[chosen], likelihood.y[chosen]
    exact = ExactLikelihood(x, y, likelihood.mean, likelihood.covariance)
    values = []
    for parameters in (trained, start):
        theta, noise, _ = likelihood.unpack(parameters)
        values.append(exact.value(np.concatenate([theta, [np.log(noise)]])))
    loss = (values[0] - values[1]) / len(chosen)
    return Verdict(loss <= TOLERATED_LOSS, loss, len(chosen))
