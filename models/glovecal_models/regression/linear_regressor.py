"""Linear calibration: a plane through the samples, the baseline and a new subject's first model.

Without any fit a sensor's range is rescaled onto the joint's active range: what a glove gives before
calibration (Wang & Neff 2013, section 5.2.2, and the "Raw" column of Table 3). The smallest and largest
reading become the ends of the range a healthy joint has.
"""

from __future__ import annotations

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
