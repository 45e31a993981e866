"""What every regressor of one rotation answers, whatever its method.

Three kinds exist: ``LinearRegressor`` (a plane), ``ProcessRegressor`` (any trained Gaussian process, exact or
sparse, in the one form prediction needs) and ``RuleRegressor`` (a rotation nobody measured, computed from
other rotations by the layout's expression). All of them are plain arrays and numbers, so that an artifact can
hold them without pickle.

The one form every trained Gaussian process is stored and served in, exact or sparse.

mean(x)     = slope . x + intercept + k(x, nodes) @ weights
variance(x) = k(x, x) - |k(x, nodes) @ variance_root|^2,     x = (inputs - input_shift) / input_scale

For an exact process (Wang & Neff 2013, equation 14, with the mean that equation drops) the nodes are the
samples and variance_root variance_root^T = (K + sigma^2 I)^-1; for SPGP (equation 19) the nodes are the
pseudo-inputs and it is Kmm^-1 - Q^-1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from glovecal_models.covariance.base import Covariance, restore_covariance
from glovecal_models.errors import BadInput, DamagedArtifact

METHODS = ("lmc_gpr", "spgp", "polynomial_gpr", "general_gpr", "gpr")
"""``gpr`` is any other exact process."""

_ROWS_AT_ONCE = 2048
"""Prediction works through long recordings in blocks, to bound its memory."""


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


@dataclass(frozen=True, eq=False)
class ProcessRegressor:
    """A trained process of one rotation; M nodes, D sensors, all variances in degrees squared."""

    method: str
    input_shift: np.ndarray
    """(D,), counts."""
    input_scale: np.ndarray
    """(D,), counts per working unit, positive."""
    slope: np.ndarray
    """(D,), degrees per working unit."""
    intercept: float
    """Degrees."""
    covariance: Covariance
    theta: np.ndarray
    """The covariance's hyperparameters, (P,)."""
    nodes: np.ndarray
    """(M, D), working units."""
    weights: np.ndarray
    """(M,)."""
    variance_root: np.ndarray
    """(M, r)."""
    noise_variance: float
    jitter: float
    """What was added to the covariance's diagonal in training, degrees squared."""
    evidence: dict[str, Any] = field(default_factory=dict)
    """JSON-able facts of the training: nlml, starts, evaluations, samples ..."""

    @property
    def hyperparameters(self) -> dict[str, float]:
        """Theta by name."""
        names = self.covariance.parameter_names(len(self.input_shift))
        return dict(zip(names, self.theta.tolist(), strict=True))

    def predict(self, inputs: np.ndarray) -> Prediction:
        """Mean and variance (without noise) at raw inputs (N, D); raises BadInput on a wrong shape."""
        inputs = self._checked(inputs)
        mean, variance = np.empty(len(inputs)), np.empty(len(inputs))
        for rows in _blocks(len(inputs)):
            x, to_nodes, mean[rows] = self._mean_of_block(inputs[rows])
            explained = to_nodes @ self.variance_root
            known = np.einsum("nr,nr->n", explained, explained)
            variance[rows] = np.maximum(self.covariance.diagonal(self.theta, x) - known, 0.0)
        return Prediction(mean, variance)

    def mean(self, inputs: np.ndarray) -> np.ndarray:
        """Of ``predict``, (N,). Raises BadInput."""
        inputs = self._checked(inputs)
        return np.concatenate(
            [np.empty(0), *(self._mean_of_block(inputs[rows])[2] for rows in _blocks(len(inputs)))]
        )

    def _checked(self, inputs: np.ndarray) -> np.ndarray:
        inputs = np.asarray(inputs, dtype=float)
        if inputs.ndim != 2 or inputs.shape[1] != len(self.input_shift):
            raise BadInput(f"readings have shape {inputs.shape}, expected (N, {len(self.input_shift)})")
        return inputs

    def _mean_of_block(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Inputs in working units (N, D), their covariance with the nodes (N, M), the mean (N,)."""
        x = (inputs - self.input_shift) / self.input_scale
        to_nodes = self.covariance(self.theta, x, self.nodes)
        return x, to_nodes, x @ self.slope + self.intercept + to_nodes @ self.weights

    def arrays(self) -> dict[str, np.ndarray]:
        return {name: np.ascontiguousarray(getattr(self, name), dtype=float) for name in _SHAPES}

    def settings(self) -> dict[str, Any]:
        return {
            "method": self.method,
            "covariance": self.covariance.settings(),
            "hyperparameters": self.hyperparameters,
            "intercept": self.intercept,
            "noise_variance": self.noise_variance,
            "jitter": self.jitter,
            "evidence": self.evidence,
        }

    @classmethod
    def restore(cls, arrays: Mapping[str, np.ndarray], settings: Mapping[str, Any]) -> ProcessRegressor:
        """Inverse of ``arrays`` and ``settings``; raises DamagedArtifact on anything that does not fit."""
        checked = _checked_arrays(arrays)
        covariance = restore_covariance(settings.get("covariance"))
        expected = len(covariance.parameter_names(len(checked["input_shift"])))
        if len(checked["theta"]) != expected:
            raise DamagedArtifact(
                f"theta has {len(checked['theta'])} entries, {covariance!r} needs {expected}"
            )
        if not (checked["input_scale"] > 0).all():
            raise DamagedArtifact("input_scale holds values that are not positive")
        method, evidence = settings.get("method"), settings.get("evidence", {})
        if method not in METHODS:
            raise DamagedArtifact(f"method is {method!r}, expected one of {', '.join(METHODS)}")
        if not isinstance(evidence, Mapping):
            raise DamagedArtifact(f"evidence is {evidence!r}, expected an object")
        return cls(
            method=str(method),
            covariance=covariance,
            intercept=stored_number(settings, "intercept", -np.inf),
            noise_variance=stored_number(settings, "noise_variance", 0.0),
            jitter=stored_number(settings, "jitter", 0.0),
            evidence=dict(evidence),
            **checked,
        )


def _blocks(count: int) -> list[slice]:
    return [slice(start, start + _ROWS_AT_ONCE) for start in range(0, count, _ROWS_AT_ONCE)]


_SHAPES: dict[str, tuple[str, ...]] = {
    "input_shift": ("D",),
    "input_scale": ("D",),
    "slope": ("D",),
    "theta": ("P",),
    "nodes": ("M", "D"),
    "weights": ("M",),
    "variance_root": ("M", "r"),
}


def _checked_arrays(arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """All arrays of ``_SHAPES``, float64 and finite, letters standing for equal lengths."""
    if set(arrays) != set(_SHAPES):
        raise DamagedArtifact(f"arrays are {sorted(arrays)}, expected {sorted(_SHAPES)}")
    lengths: dict[str, int] = {}
    for name, letters in _SHAPES.items():
        array = arrays[name]
        if array.dtype != np.float64 or not np.isfinite(array).all():
            raise DamagedArtifact(
                f"{name} must be finite 64-bit floats, not {array.dtype} with NaN or infinity"
            )
        if array.ndim != len(letters):
            raise DamagedArtifact(f"{name} has shape {array.shape}, expected ({', '.join(letters)})")
        for letter, length in zip(letters, array.shape, strict=True):
            if lengths.setdefault(letter, length) != length:
                raise DamagedArtifact(f"{name} has shape {array.shape}, but {letter} is {lengths[letter]}")
    if lengths["D"] == 0:
        raise DamagedArtifact("input_shift is empty; a regressor has at least one sensor")
    return dict(arrays)
