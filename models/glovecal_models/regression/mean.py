"""Mean functions of a process: linear in their coefficients, which training therefore solves for."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from scipy.linalg import lstsq


class Mean(ABC):
    """m(x) = basis(x) @ coefficients, a plane or a part of one."""

    @abstractmethod
    def basis(self, x: np.ndarray) -> np.ndarray:
        """The columns (N, C) whose combination the mean is, for x (N, D)."""

    @abstractmethod
    def plane(self, coefficients: np.ndarray, dimensions: int) -> tuple[np.ndarray, float]:
        """Slope (D,) and intercept of the mean with these coefficients (C,)."""


class ZeroMean(Mean):
    """m_0 of Wang & Neff (2013), Table 2. Training centres the target, so zero is the samples' average."""

    def basis(self, x: np.ndarray) -> np.ndarray:
        return np.empty((len(x), 0))

    def plane(self, coefficients: np.ndarray, dimensions: int) -> tuple[np.ndarray, float]:
        return np.zeros(dimensions), 0.0


class LinearMean(Mean):
    """m_l(x) = slope . x + intercept (Wang & Neff 2013, equation 7, with the intercept it leaves out)."""

    def basis(self, x: np.ndarray) -> np.ndarray:
        return np.column_stack([x, np.ones(len(x))])

    def plane(self, coefficients: np.ndarray, dimensions: int) -> tuple[np.ndarray, float]:
        return coefficients[:-1].copy(), float(coefficients[-1])


def profile_coefficients(whitened_basis: np.ndarray, whitened_target: np.ndarray) -> np.ndarray:
    """The coefficients of greatest likelihood (generalised least squares), of least norm if many do.

    Both arguments are multiplied by the inverse root of the target's covariance. Solving for the mean at
    every step instead of searching for it leaves fewer parameters and needs several times fewer steps;
    by the envelope theorem the other gradients are those at fixed coefficients.
    """
    if whitened_basis.shape[1] == 0:
        return np.empty(0)
    return _least_squares(whitened_basis, whitened_target, cutoff=1e-10)


def profile_coefficients_from_products(products: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The same from the normal equations: basis^T C^-1 basis (C, C) and basis^T C^-1 target (C,)."""
    return _least_squares(products, right, cutoff=1e-12) if len(right) else np.empty(0)


def _least_squares(matrix: np.ndarray, right: np.ndarray, cutoff: float) -> np.ndarray:
    solution = lstsq(matrix, right, cond=cutoff, check_finite=False)
    assert solution is not None
    return solution[0]
