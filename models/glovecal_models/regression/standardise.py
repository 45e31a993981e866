"""The units training works in: every sensor and the target with mean 0 and standard deviation 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Standardised:
    """Samples in working units: inputs = input_shift + input_scale * x, target = likewise with y."""

    x: np.ndarray
    """Shape (N, D)."""
    y: np.ndarray
    """Shape (N,)."""
    input_shift: np.ndarray
    input_scale: np.ndarray
    target_shift: float
    """Degrees."""
    target_scale: float
    """Degrees; variances in working units times its square are degrees squared."""


def standardise(inputs: np.ndarray, target: np.ndarray) -> Standardised:
    """Shift and scale checked samples (``check_samples``): inputs (N, D), target (N,) in degrees."""
    input_shift, input_scale = inputs.mean(axis=0), inputs.std(axis=0)
    target_shift, target_scale = float(target.mean()), float(target.std())
    return Standardised(
        x=(inputs - input_shift) / input_scale,
        y=(target - target_shift) / target_scale,
        input_shift=input_shift,
        input_scale=input_scale,
        target_shift=target_shift,
        target_scale=target_scale,
    )
