"""Linear calibration: a plane through the samples, the baseline and a new subject's first model.

Without any fit a sensor's range is rescaled onto the joint's active range: what a glove gives before
calibration (Wang & Neff 2013, section 5.2.2, and the "Raw" column of Table 3). The smallest and largest
reading become the ends of the range a healthy joint has.

Mean functions of a process: linear in their coefficients, which training therefore solves for.

Lines of which something is known before any fit: the slope along one input, or all of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import cholesky, lstsq, solve_triangular

from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.progress import Cancel, Report, stop_if
from glovecal_models.regression.regressor import Prediction, stored_number
from glovecal_models.regression.training_samples import check_samples, standardise

_PRIOR_SLOPE = 10.0
"""How steep a direction nobody moved in could be, in target deviations per input deviation."""


@dataclass(frozen=True, eq=False)
class LinearRegressor:
    """mean = slope . x + intercept, variance = |[x 1] @ variance_root|^2, x = (inputs - shift) / scale."""

    input_shift: np.ndarray
    """(D,), counts."""
    input_scale: np.ndarray
    """(D,), counts per working unit, positive."""
    slope: np.ndarray
    """(D,), degrees per working unit."""
    intercept: float
    """Degrees."""
    variance_root: np.ndarray
    """(D + 1, D + 1), root of the posterior covariance of slope and intercept, degrees."""
    noise_variance: float
    evidence: dict[str, Any] = field(default_factory=dict)
    method: str = field(default="linear", init=False)

    def predict(self, inputs: np.ndarray) -> Prediction:
        """Mean and variance (without noise) at raw inputs (N, D); raises BadInput on a wrong shape."""
        inputs = np.asarray(inputs, dtype=float)
        if inputs.ndim != 2 or inputs.shape[1] != len(self.input_shift):
            raise BadInput(f"readings have shape {inputs.shape}, expected (N, {len(self.input_shift)})")
        x = (inputs - self.input_shift) / self.input_scale
        spread = x @ self.variance_root[:-1] + self.variance_root[-1]
        return Prediction(x @ self.slope + self.intercept, np.einsum("nr,nr->n", spread, spread))

    def mean(self, inputs: np.ndarray) -> np.ndarray:
        """Of ``predict``, (N,)."""
        return self.predict(inputs).mean

    def arrays(self) -> dict[str, np.ndarray]:
        return {name: np.ascontiguousarray(getattr(self, name), dtype=float) for name in _ARRAYS}

    def settings(self) -> dict[str, Any]:
        return {
            "method": self.method,
            "intercept": self.intercept,
            "noise_variance": self.noise_variance,
            "evidence": self.evidence,
        }

    @classmethod
    def restore(cls, arrays: Mapping[str, np.ndarray], settings: Mapping[str, Any]) -> LinearRegressor:
        """Inverse of ``arrays`` and ``settings``; raises DamagedArtifact on anything that does not fit."""
        if set(arrays) != set(_ARRAYS):
            raise DamagedArtifact(f"arrays are {sorted(arrays)}, expected {sorted(_ARRAYS)}")
        dimensions = arrays["input_shift"].size
        for name, array in arrays.items():
            shape = (dimensions + 1,) * 2 if name == "variance_root" else (dimensions,)
            if array.shape != shape or array.dtype != np.float64 or not np.isfinite(array).all():
                raise DamagedArtifact(
                    f"{name} is {array.dtype} {array.shape}, expected finite float64 {shape}"
                )
        if dimensions == 0 or not (arrays["input_scale"] > 0).all():
            raise DamagedArtifact("input_scale must hold one positive number per sensor")
        if settings.get("method") != "linear":
            raise DamagedArtifact(f"method is {settings.get('method')!r}, expected linear")
        evidence = settings.get("evidence", {})
        if not isinstance(evidence, Mapping):
            raise DamagedArtifact(f"evidence is {evidence!r}, expected an object")
        return cls(
            **arrays,
            intercept=stored_number(settings, "intercept", -np.inf),
            noise_variance=stored_number(settings, "noise_variance", 0.0),
            evidence=dict(evidence),
        )


_ARRAYS = ("input_shift", "input_scale", "slope", "variance_root")


def fit_linear(
    inputs: np.ndarray,
    target: np.ndarray,
    *,
    sensor_names: Sequence[str] | None = None,
    precision: np.ndarray | None = None,
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> LinearRegressor:
    """Least squares, of least norm where collinear sensors leave it open; inputs (N, D), target (N,) degrees.

    The mean has no ridge. The variance is the posterior of the plane under a slope prior so wide that it
    only shows in directions the samples never moved in: there the plane is unknown, and says so.
    ``precision`` (N,): relative, of each sample; ``noise_variance`` is that of a sample of precision 1.
    Raises NotTrainable (at least D + 2 samples), Cancelled.
    """
    stop_if(cancelled, "training")
    dimensions = np.shape(inputs)[1] if np.ndim(inputs) == 2 else 1
    working = standardise(*check_samples(inputs, target, sensor_names, least=dimensions + 2))
    basis, goal = np.column_stack([working.x, np.ones(len(working.y))]), working.y
    if precision is not None:
        root = np.sqrt(precision)
        basis, goal = root[:, None] * basis, root * goal
    solution = lstsq(basis, goal, cond=1e-10)
    assert solution is not None
    coefficients, rank = solution[0], int(solution[2])
    residual = goal - basis @ coefficients
    noise = float(residual @ residual) / max(len(residual) - rank, 1)
    scale = working.target_scale
    if report is not None:
        report("plane fitted", 1.0)
    return LinearRegressor(
        input_shift=working.input_shift,
        input_scale=working.input_scale,
        slope=scale * coefficients[:-1],
        intercept=working.target_shift + scale * float(coefficients[-1]),
        variance_root=scale * _posterior_root(basis, noise),
        noise_variance=noise * scale**2,
        evidence={"trainer": "linear", "samples": len(residual), "rank": rank},
    )


def _posterior_root(basis: np.ndarray, noise: float) -> np.ndarray:
    """Root of (B^T B / noise + I / prior^2)^-1, computed without dividing by a noise of zero."""
    noise = max(noise, 1e-12)
    precision = basis.T @ basis + noise / _PRIOR_SLOPE**2 * np.eye(basis.shape[1])
    precision += 1e-14 * len(basis) * np.eye(basis.shape[1])
    lower = cholesky(precision, lower=True)
    return np.sqrt(noise) * solve_triangular(lower, np.eye(len(lower)), lower=True).T


def rescale_readings(
    inputs: np.ndarray,
    target: np.ndarray,
    active_range_deg: tuple[float, float] | None,
    *,
    sensor_names: Sequence[str] | None = None,
) -> LinearRegressor:
    """The rescaling of the first input; inputs (N, D) counts, target (N,) degrees, range in degrees.

    Without a range that of the target is taken.

    The target only tells which way the sensor counts and how large the error is. Raises NotTrainable.
    """
    inputs, target = check_samples(inputs, target, sensor_names)
    active_range_deg = active_range_deg or (float(target.min()), float(target.max()))
    reading = inputs[:, 0]
    low, high = float(reading.min()), float(reading.max())
    rising = np.mean((reading - reading.mean()) * (target - target.mean())) >= 0
    start, end = active_range_deg if rising else active_range_deg[::-1]
    slope = np.zeros(inputs.shape[1])
    slope[0] = end - start
    scale = np.ptp(inputs, axis=0)
    mean = start + (reading - low) / (high - low) * slope[0]
    return LinearRegressor(
        input_shift=inputs.min(axis=0),
        input_scale=np.where(scale > 0, scale, 1.0),
        slope=slope,
        intercept=float(start),
        variance_root=np.zeros((len(slope) + 1, len(slope) + 1)),
        noise_variance=float(np.mean((mean - target) ** 2)),
        evidence={"trainer": "rescaling", "samples": len(target), "active_range_deg": [start, end]},
    )


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


def line_of(
    gains: Sequence[float], offset_deg: float, noise_deg: float, evidence: dict[str, Any]
) -> LinearRegressor:
    """angle = gains . readings + offset. Gains (D,) in degrees a count; the line itself counts as certain."""
    count = len(gains)
    return LinearRegressor(
        input_shift=np.zeros(count),
        input_scale=np.ones(count),
        slope=np.asarray(gains, dtype=float),
        intercept=float(offset_deg),
        variance_root=np.zeros((count + 1, count + 1)),
        noise_variance=float(noise_deg) ** 2,
        evidence=evidence,
    )


def gains_of(regressor: LinearRegressor) -> tuple[np.ndarray, float]:
    """Gains (D,) in degrees a count and the offset in degrees at readings of 0."""
    gains = regressor.slope / regressor.input_scale
    return gains, float(regressor.intercept - gains @ regressor.input_shift)


def fit_beside(
    inputs: np.ndarray, target: np.ndarray, known_gain: float, *, sensor_names: Sequence[str] | None = None
) -> LinearRegressor:
    """Scale and offset of the first of two inputs (N, 2) by least squares; the second turns by ``known_gain``
    degrees a count. Raises NotTrainable.
    """
    beside = inputs[:, 1]
    names = None if sensor_names is None else sensor_names[:1]
    own = fit_linear(inputs[:, :1], target - known_gain * beside, sensor_names=names)
    root = np.zeros((3, 3))
    root[np.ix_((0, 2), (0, 2))] = own.variance_root
    shift = float(beside.mean())
    return LinearRegressor(
        input_shift=np.append(own.input_shift, shift),
        input_scale=np.append(own.input_scale, 1.0),
        slope=np.append(own.slope, known_gain),
        intercept=own.intercept + known_gain * shift,
        variance_root=root,
        noise_variance=own.noise_variance,
        evidence=own.evidence | {"trainer": "template", "known_gain_deg_per_count": known_gain},
    )
