"""The processes that are tried on hardware nobody knows (Wang & Neff 2013, section 8.1), each in one entry.

The paper names two roads for sensors that are not linear: a polynomial covariance in place of the linear
term of its model, and (m_0, k_seARD + k_seARD) for sensors of unknown properties.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_models.covariance.base import Covariance
from glovecal_models.covariance.polynomial import Polynomial
from glovecal_models.covariance.squared_exponential_ard import SquaredExponentialArd
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.kernel_process import fit_process
from glovecal_models.regression.mean import LinearMean, Mean, ZeroMean
from glovecal_models.regression.process_regressor import ProcessRegressor

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
        seed: int = 0,
        cancelled: Callable[[], bool] | None = None,
        **search: Any,
    ) -> ProcessRegressor:
        """Train on inputs (N, D), counts, and target (N,), degrees; ``search`` goes to ``fit_process``.

        Raises NotTrainable, Cancelled.
        """
        if self.name == LMC:
            return fit_lmc_gpr(inputs, target, sample_weight=sample_weight, seed=seed, cancelled=cancelled)
        return fit_process(
            inputs, target, self.mean, self.covariance, self.method,
            sample_weight=sample_weight, seed=seed, cancelled=cancelled, **search,
        )  # fmt: skip


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
