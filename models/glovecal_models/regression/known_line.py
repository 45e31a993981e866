"""Lines of which something is known before any fit: the slope along one input, or all of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from glovecal_models.regression.linear_regressor import LinearRegressor, fit_linear


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
