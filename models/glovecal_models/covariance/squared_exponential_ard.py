"""k_seARD of Wang & Neff (2013), equation 8: smooth functions with one relevance per input."""

from __future__ import annotations

import numpy as np

from glovecal_models.covariance.base import Covariance, Pullback
from glovecal_models.covariance.scaled_distance import squared_exponential, weighted_differences


class SquaredExponentialArd(Covariance):
    """k(a, b) = eta exp(-1/2 sum_d gamma_d (a_d - b_d)^2); theta = log eta, log gamma_1 ... log gamma_D.

    gamma_d is the relevance of input d, one over its squared lengthscale.
    """

    kind = "squared_exponential_ard"

    def parameter_names(self, dimensions: int) -> list[str]:
        return ["log_signal_variance", *(f"log_relevance_{d}" for d in range(1, dimensions + 1))]

    def bounds(self, dimensions: int) -> list[tuple[float, float]]:
        return [(-14.0, 9.0), *[(-14.0, 7.0)] * dimensions]

    def initial(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Half the target's variance, lengthscales of about the whole spread of the points."""
        dimensions = x.shape[1]
        relevance = 1.0 / (dimensions * np.maximum(x.var(axis=0), 1e-12))
        return np.concatenate([[np.log(max(0.5 * float(y.var()), 1e-12))], np.log(relevance)])

    def with_pullback(
        self, theta: np.ndarray, a: np.ndarray, b: np.ndarray, out: np.ndarray | None = None
    ) -> tuple[np.ndarray, Pullback]:
        values = squared_exponential(theta[0], np.exp(0.5 * theta[1:]), a, b, out)

        def pullback(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            total, by_relevance, by_a = weighted_differences(weights, values, np.exp(theta[1:]), a, b)
            return np.concatenate([[total], by_relevance]), by_a

        return values, pullback

    def diagonal(self, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
        return np.full(len(a), np.exp(theta[0]))

    def diagonal_pullback(
        self, theta: np.ndarray, a: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        gradient = np.zeros(len(theta))
        gradient[0] = np.exp(theta[0]) * weights.sum()
        return gradient, np.zeros_like(a)

    def scaled(self, theta: np.ndarray, factor: float) -> np.ndarray:
        return np.concatenate([[theta[0] + np.log(factor)], theta[1:]])
