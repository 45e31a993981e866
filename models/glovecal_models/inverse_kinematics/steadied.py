"""Predicted angles without the sensors' noise: hands move on smooth curves, noise is new in every frame.

Where the calibration hardly knows a joint, a touch would hand it the noise of all others, many times over.
"""

from __future__ import annotations

import itertools

import numpy as np

WINDOW_S = 0.15
"""A parabola follows a hand over this long: its tremor, the fastest it does, is at 7 to 11 Hz."""
DEGREE = 2
GAP = 3.0
"""Frames this many usual intervals apart do not belong to one curve."""


def steadied(time_s: np.ndarray, angles_deg: np.ndarray, window_s: float = WINDOW_S) -> np.ndarray:
    """Each frame's place on the parabola through its neighbours of ``window_s`` (Savitzky & Golay 1964),
    shape (N, R).

    Stretches that are too short, or frames too rare, for more than a parabola's own points stay as they are.
    """
    if len(time_s) < DEGREE + 2:
        return angles_deg
    intervals = np.diff(time_s)
    usual = float(np.median(intervals))
    window = 2 * round(window_s / usual / 2) + 1
    if window < DEGREE + 2:
        return angles_deg
    from scipy.signal import savgol_filter  # takes a second to load, which most commands need not wait for

    smooth = angles_deg.copy()
    ends = [0, *np.flatnonzero(intervals > GAP * usual) + 1, len(time_s)]
    for start, end in itertools.pairwise(ends):
        if end - start >= window:
            smooth[start:end] = savgol_filter(angles_deg[start:end], window, DEGREE, axis=0)
    return smooth
