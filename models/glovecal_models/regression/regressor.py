"""What every regressor of one rotation answers, whatever its method.

Three kinds exist: ``LinearRegressor`` (a plane), ``ProcessRegressor`` (any trained Gaussian process,
exact or sparse, in the one form prediction needs) and ``RuleRegressor`` (a rotation nobody measured,
computed from other rotations by the layout's expression). All of them are plain arrays and numbers, so
that an artifact can hold them without pickle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np


@dataclass(frozen=True)
class Prediction:
    """Predicted rotation of N frames."""

    mean: np.ndarray
    """Degrees, shape (N,)."""
    variance: np.ndarray
    """Variance of the rotation itself (without measurement noise), degrees squared, shape (N,)."""


class Regressor(Protocol):
    """One rotation's map from inputs (N, D), raw counts, to degrees."""

    @property
    def method(self) -> str:
        """``linear``, ``lmc_gpr``, ``polynomial_gpr``, ``general_gpr``, ``spgp`` or ``rule``."""
        ...

    @property
    def noise_variance(self) -> float:
        """Variance of the measurement noise learned in training, degrees squared."""
        ...

    def predict(self, inputs: np.ndarray) -> Prediction:
        """Mean and variance at ``inputs`` of shape (N, D)."""
        ...

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything numerical, for the artifact. Float64, finite."""
        ...

    def settings(self) -> dict[str, Any]:
        """Everything else (names, hyperparameters by name, jitter), JSON-able."""
        ...

    @classmethod
    def restore(cls, arrays: Mapping[str, np.ndarray], settings: Mapping[str, Any]) -> Regressor:
        """Inverse of ``arrays`` and ``settings``; raises DamagedArtifact on wrong shapes or values."""
        ...
