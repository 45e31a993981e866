"""Signals in time: smooth ones between the points of an even grid, and noise that lasts."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter


def at_times(grid_s: np.ndarray, values: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """``values`` (N, C), given at ``grid_s`` (N,), at ``times_s`` (M,): shape (M, C), cubic in between.

    Straight lines would flatten a fast finger by half a degree at 60 frames a second.
    """
    return np.asarray(CubicSpline(grid_s, values, axis=0)(np.clip(times_s, grid_s[0], grid_s[-1])))


def lasting_noise(
    random: np.random.Generator, frames: int, channels: int, lasts_s: float, rate_hz: float
) -> np.ndarray:
    """Shape (frames, channels), standard deviation 1, correlation falling to 1/e within ``lasts_s``."""
    keep = np.exp(-1.0 / (lasts_s * rate_hz))
    drive = np.sqrt(1 - keep**2) * random.standard_normal((frames, channels))
    drive[0] = random.standard_normal(channels)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))
