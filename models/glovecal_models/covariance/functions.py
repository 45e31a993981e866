"""The inhomogeneous polynomial covariance (Rasmussen & Williams 2006, equation 4.22).

k_LARD of Wang & Neff (2013), equation 8: linear functions with one slope variance per input.

Squared exponential covariances: smooth functions, with one lengthscale for all inputs or one for each.

k_RBF of Wang & Neff (2013), section 6.1.1, and k_seARD of its equation 8. Squared distances in scaled inputs,
and the sums over them that gradients need, are computed without N x N x D arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from glovecal_models.covariance.base import Covariance, Pullback
from glovecal_models.errors import BadInput, DamagedArtifact

_HIGHEST_DEGREE = 8
_BLOCK_ENTRIES = 32_768


class Polynomial(Covariance):
    """k(a, b) = variance (a . b + offset)^degree; theta = log variance, log offset.

    Its functions are the polynomials of at most ``degree`` (1 to 8) in all inputs.
    """

    kind = "polynomial"

    def __init__(self, degree: int) -> None:
        if isinstance(degree, bool) or not isinstance(degree, int) or not 1 <= degree <= _HIGHEST_DEGREE:
            raise BadInput(f"degree is {degree!r}, expected a whole number from 1 to {_HIGHEST_DEGREE}")
        self.degree = degree

    def parameter_names(self, dimensions: int) -> list[str]:
        return ["log_variance", "log_offset"]

    def bounds(self, dimensions: int) -> list[tuple[float, float]]:
        return [(-20.0, 9.0), (-7.0, 4.0)]

    def initial(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Offset 1 and half the target's variance at a typical point."""
        typical = float((x * x).sum(axis=1).mean()) + 1.0
        return np.array([np.log(max(0.5 * float(y.var()), 1e-12)) - self.degree * np.log(typical), 0.0])

    def with_pullback(
        self, theta: np.ndarray, a: np.ndarray, b: np.ndarray, out: np.ndarray | None = None
    ) -> tuple[np.ndarray, Pullback]:
        variance, offset = np.exp(theta)
        base = a @ b.T + offset
        lower_power = variance * base ** (self.degree - 1)

        def pullback(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            slopes = weights * lower_power
            total = float(np.vdot(slopes, base))
            return np.array([total, self.degree * offset * slopes.sum()]), self.degree * (slopes @ b)

        return np.multiply(lower_power, base, out=out), pullback

    def diagonal(self, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
        variance, offset = np.exp(theta)
        return variance * ((a * a).sum(axis=1) + offset) ** self.degree

    def diagonal_pullback(
        self, theta: np.ndarray, a: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        variance, offset = np.exp(theta)
        base = (a * a).sum(axis=1) + offset
        slopes = weights * variance * base ** (self.degree - 1)
        by_theta = np.array([float(slopes @ base), self.degree * offset * slopes.sum()])
        return by_theta, 2 * self.degree * slopes[:, None] * a

    def scaled(self, theta: np.ndarray, factor: float) -> np.ndarray:
        return np.array([theta[0] + np.log(factor), theta[1]])

    def settings(self) -> dict[str, Any]:
        return {"kind": self.kind, "degree": self.degree}

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Covariance:
        try:
            return cls(settings.get("degree"))  # pyright: ignore[reportArgumentType]  checked inside
        except BadInput as error:
            raise DamagedArtifact(f"polynomial covariance: {error}") from error

    def __repr__(self) -> str:
        return f"Polynomial({self.degree})"


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


def squared_exponential(
    log_variance: float,
    inverse_lengthscales: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """exp(log_variance - 1/2 |L (a - b)|^2) with L = diag(inverse_lengthscales); (A, D), (B, D) -> (A, B).

    The distance is expanded (one matrix product), so points are moved to b's middle first: the rounding
    error grows with their distance from the origin. A slightly negative distance is cut to zero.
    """
    middle = b.mean(axis=0)
    a, b = (a - middle) * inverse_lengthscales, (b - middle) * inverse_lengthscales
    a_terms = np.column_stack([a, -0.5 * np.einsum("id,id->i", a, a), np.ones(len(a))])
    b_terms = np.column_stack([b, np.ones(len(b)), -0.5 * np.einsum("id,id->i", b, b)])
    values = np.matmul(a_terms, b_terms.T, out=out)
    np.minimum(values, 0.0, out=values)
    np.exp(values, out=values)
    return np.multiply(values, np.exp(log_variance), out=values)


def weighted_differences(
    weights: np.ndarray, values: np.ndarray, relevance: np.ndarray, a: np.ndarray, b: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Sums over T = weights * values (A, B), values being a k of sum_d relevance_d (a_d - b_d)^2 / 2.

    Returns sum(T), the gradient by log relevance (D,), and by a (A, D). T is never built whole: blocks
    of it stay in the cache.
    """
    towards, rows, columns = np.empty_like(a), np.empty(len(a)), np.zeros(len(b))
    block = max(1, _BLOCK_ENTRIES // max(len(b), 1))
    product = np.empty((block, len(b)))
    for start in range(0, len(a), block):
        part = slice(start, start + block)
        size = len(rows[part])
        weighted = np.multiply(weights[part], values[part], out=product[:size])
        towards[part] = weighted @ b
        rows[part] = weighted.sum(axis=1)
        columns += weighted.sum(axis=0)
    squares = rows @ (a * a) - 2 * (a * towards).sum(axis=0) + columns @ (b * b)
    return float(rows.sum()), -0.5 * relevance * squares, relevance * (towards - rows[:, None] * a)


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
