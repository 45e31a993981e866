"""How far the readings of one sensor are from what its joint's measured angle asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.sensor_fault.short_faults import straight_line

PIECES = 30
FEWEST_READINGS = 300
LEAST_ANGLES_DEG = 3.0


@dataclass(frozen=True)
class ReadingErrors:
    """Of one sensor in several takes, in degrees of its joint."""

    errors: tuple[np.ndarray, ...]
    """(N,) for each take; NaN where there is no reference, or the frame is left out."""
    readings: tuple[np.ndarray, ...]
    """(N,) for each take, growing with the angle."""
    angles: tuple[np.ndarray, ...]
    """(N,) for each take, measured; NaN as in ``errors``."""
    rate_hz: float


def reading_errors(
    times: Sequence[np.ndarray], readings: Sequence[np.ndarray], angles: Sequence[np.ndarray]
) -> ReadingErrors | None:
    """``readings`` (N,) counts of each take, ``angles`` (N,) degrees, NaN: not to be used; None: too few.

    The curve is free in its form (means over quantiles of the angle), so that no bend of the sensor is left.
    """
    x, y = np.concatenate(readings), np.concatenate(angles)
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < FEWEST_READINGS or np.ptp(y[known]) < LEAST_ANGLES_DEG:
        return None
    intervals = np.concatenate([np.diff(time) for time in times])
    gain, _ = straight_line(y[known], x[known])
    if gain == 0 or not len(intervals):
        return None
    edges = np.unique(np.quantile(y[known], np.linspace(0.0, 1.0, PIECES + 1)))
    piece = np.clip(np.searchsorted(edges, y[known], side="right") - 1, 0, len(edges) - 2)
    count = np.bincount(piece, minlength=len(edges) - 1)
    used = count > 0
    at = np.bincount(piece, y[known], len(count))[used] / count[used]
    height = np.bincount(piece, x[known], len(count))[used] / count[used]
    # Beyond the outer means the sensor goes on in a straight line.
    beyond = np.minimum(y - at[0], 0.0) + np.maximum(y - at[-1], 0.0)
    error = (x - np.interp(y, at, height) - gain * beyond) / gain
    ends = np.cumsum([len(part) for part in readings])[:-1]
    return ReadingErrors(
        tuple(np.split(error, ends)),
        tuple(np.split(x / gain, ends)),
        tuple(angles),
        1.0 / float(np.median(intervals)),
    )
