"""Raw readings as angles: a sensor's range rescaled onto the joint's active range, with no fit at all.

What a glove gives before calibration (Wang & Neff 2013, section 5.2.2, and the "Raw" column of Table 3):
the smallest and largest reading become the ends of the range a healthy joint has.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_models.regression.training_check import check_samples


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
