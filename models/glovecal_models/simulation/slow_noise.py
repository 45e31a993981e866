"""Noise that lasts: first-order (Ornstein-Uhlenbeck), started in its steady state."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter


def lasting_noise(
    random: np.random.Generator, frames: int, channels: int, lasts_s: float, rate_hz: float
) -> np.ndarray:
    """Shape (frames, channels), standard deviation 1, correlation falling to 1/e within ``lasts_s``."""
    keep = np.exp(-1.0 / (lasts_s * rate_hz))
    drive = np.sqrt(1 - keep**2) * random.standard_normal((frames, channels))
    drive[0] = random.standard_normal(channels)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))
