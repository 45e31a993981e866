"""k_LARD of Wang & Neff (2013), equation 8: linear functions with one slope variance per input."""

from __future__ import annotations

import numpy as np

from glovecal_models.covariance.base import Covariance, Pullback


class LinearArd(Covariance):
    """k(a, b) = sum_d beta_d a_d b_d; theta = log beta_1 ... log beta_D.

    Training centres the inputs, so the functions pass through the middle of the samples (the mean's
    intercept moves them). Beside a linear mean with free coefficients this term is redundant: at the
    optimum its variances vanish (the paper's two rows with and without it differ by 0.05 % in Table 2).
    """

    kind = "linear_ard"

    def parameter_names(self, dimensions: int) -> list[str]:
        return [f"log_slope_variance_{d}" for d in range(1, dimensions + 1)]

    def initial(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Half the target's variance, shared by the inputs."""
        share = 0.5 * float(y.var()) / (x.shape[1] * np.maximum(x.var(axis=0), 1e-12))
        return np.log(np.maximum(share, 1e-12))

    def with_pullback(
        self, theta: np.ndarray, a: np.ndarray, b: np.ndarray, out: np.ndarray | None = None
    ) -> tuple[np.ndarray, Pullback]:
        beta = np.exp(theta)

        def pullback(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            by_a = (weights @ b) * beta
            return (by_a * a).sum(axis=0), by_a

        return np.matmul(a * beta, b.T, out=out), pullback

    def diagonal(self, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
        return (a * a) @ np.exp(theta)

    def diagonal_pullback(
        self, theta: np.ndarray, a: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        weighted = weights[:, None] * a * np.exp(theta)
        return (weighted * a).sum(axis=0), 2 * weighted

    def scaled(self, theta: np.ndarray, factor: float) -> np.ndarray:
        return theta + np.log(factor)
