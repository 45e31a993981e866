"""The inhomogeneous polynomial covariance (Rasmussen & Williams 2006, equation 4.22)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from glovecal_models.covariance.base import Covariance, Pullback
from glovecal_models.errors import BadInput, DamagedArtifact

_HIGHEST_DEGREE = 8


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
