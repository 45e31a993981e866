"""What every regressor of one rotation answers, whatever its method.

Three kinds exist: ``LinearRegressor`` (a plane), ``ProcessRegressor`` (any trained Gaussian process, exact or
sparse, in the one form prediction needs) and ``RuleRegressor`` (a rotation nobody measured, computed from
other rotations by the layout's expression). All of them are plain arrays and numbers, so that an artifact can
hold them without pickle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from glovecal_models.errors import DamagedArtifact


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

    def mean(self, inputs: np.ndarray) -> np.ndarray:
        """The mean of ``predict`` alone, (N,): the variance is the dearer part."""
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


def stored_number(settings: Mapping[str, Any], name: str, least: float) -> float:
    """``settings[name]`` as a float; raises DamagedArtifact unless finite and at least ``least``."""
    value = settings.get(name)
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not np.isfinite(value)
        or value < least
    ):
        raise DamagedArtifact(f"{name} is {value!r}, expected a finite number of at least {least:g}")
    return float(value)


@dataclass(frozen=True)
class RuleRegressor:
    """Weighted sum of other rotations; ``predict`` takes those rotations (degrees) as inputs."""

    rotations: tuple[str, ...]
    weights: np.ndarray
    """Shape (len(rotations),), degrees per degree."""

    @property
    def method(self) -> str:
        return "rule"

    @property
    def noise_variance(self) -> float:
        return 0.0

    def predict(self, inputs: np.ndarray) -> Prediction:
        """Mean and (zero) variance from rotations in degrees, shape (N, len(rotations))."""
        inputs = np.asarray(inputs, dtype=float)
        return Prediction(inputs @ self.weights, np.zeros(len(inputs)))

    def mean(self, inputs: np.ndarray) -> np.ndarray:
        return self.predict(inputs).mean

    def arrays(self) -> dict[str, np.ndarray]:
        return {"weights": np.asarray(self.weights, dtype=np.float64)}

    def settings(self) -> dict[str, Any]:
        return {"method": "rule", "rotations": list(self.rotations)}

    @classmethod
    def restore(cls, arrays: Mapping[str, np.ndarray], settings: Mapping[str, Any]) -> RuleRegressor:
        rotations, weights = tuple(settings.get("rotations", ())), arrays.get("weights")
        if weights is None or weights.shape != (len(rotations),) or not np.isfinite(weights).all():
            raise DamagedArtifact(f"rule for {len(rotations)} rotations needs as many finite weights")
        return cls(rotations, weights)
