"""k_RBF of Wang & Neff (2013), section 6.1.1: smooth functions with one lengthscale for all inputs."""

from __future__ import annotations

import numpy as np

from glovecal_models.covariance.base import Covariance, Pullback
from glovecal_models.covariance.scaled_distance import squared_exponential, weighted_differences


class SquaredExponential(Covariance):
    """k(a, b) = eta exp(-gamma/2 |a - b|^2); theta = log eta, log gamma."""

    kind = "squared_exponential"

    def parameter_names(self, dimensions: int) -> list[str]:
        return ["log_signal_variance", "log_relevance"]

    def bounds(self, dimensions: int) -> list[tuple[float, float]]:
        return [(-14.0, 9.0), (-14.0, 7.0)]

    def initial(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Half the target's variance, a lengthscale of about the whole spread of the points."""
        spread = max(float(x.var(axis=0).sum()), 1e-12)
        return np.log([max(0.5 * float(y.var()), 1e-12), 1.0 / spread])

    def with_pullback(
        self, theta: np.ndarray, a: np.ndarray, b: np.ndarray, out: np.ndarray | None = None
    ) -> tuple[np.ndarray, Pullback]:
        relevance = np.full(a.shape[1], np.exp(theta[1]))
        values = squared_exponential(theta[0], np.sqrt(relevance), a, b, out)

        def pullback(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            total, by_relevance, by_a = weighted_differences(weights, values, relevance, a, b)
            return np.array([total, by_relevance.sum()]), by_a

        return values, pullback

    def diagonal(self, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
        return np.full(len(a), np.exp(theta[0]))

    def diagonal_pullback(
        self, theta: np.ndarray, a: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        return np.array([np.exp(theta[0]) * weights.sum(), 0.0]), np.zeros_like(a)

    def scaled(self, theta: np.ndarray, factor: float) -> np.ndarray:
        return np.array([theta[0] + np.log(factor), theta[1]])
