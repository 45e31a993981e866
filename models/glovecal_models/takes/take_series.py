"""A take as it is drawn: readings, reference, where frames are missing, where the reference jumps."""

from __future__ import annotations

import numpy as np

from glovecal_models.takes.answer import Curves, JumpInTake, TakeSeries
from glovecal_models.takes.reference_jumps import reference_jumps
from glovecal_models.takes.shown_frames import shown_frames
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import GAP_INTERVALS

SPECTRUM_POINTS = 120


def take_series(
    take: Take, *, from_s: float | None = None, to_s: float | None = None, points: int = 2000
) -> TakeSeries:
    """``from_s`` to ``to_s``, seconds since the take's first frame (default: all of it); at most ``points``
    frames and reference rows each, no extreme lost."""
    began = float(take.time_s[0])
    frames = _within(take.time_s - began, from_s, to_s)
    rows = _within(take.reference_time_s - began, from_s, to_s)
    steps = np.diff(take.time_s)
    typical = float(np.median(steps)) if len(steps) else 0.0
    missing = np.flatnonzero(steps > GAP_INTERVALS * typical) if typical > 0 else []
    return TakeSeries(
        take.name,
        take.duration_s,
        1.0 / typical if typical > 0 else None,
        take.start_s - began,
        _curves(take.time_s[frames] - began, take.sensors, take.readings[frames], points),
        _curves(take.reference_time_s[rows] - began, take.rotations, take.reference[rows], points),
        [(float(take.time_s[at]) - began, float(take.time_s[at + 1]) - began) for at in missing],
        [
            JumpInTake(at.rotation, at.start_s - began, at.end_s - began, at.size_deg, at.comes_back)
            for at in reference_jumps(take)
        ],
        _spectra(take, typical),
    )


def _within(time_s: np.ndarray, from_s: float | None, to_s: float | None) -> np.ndarray:
    low, high = -np.inf if from_s is None else from_s, np.inf if to_s is None else to_s
    return np.flatnonzero((time_s >= low) & (time_s <= high))


def _curves(time_s: np.ndarray, names: tuple[str, ...], values: np.ndarray, points: int) -> Curves:
    if not names or not len(time_s):
        return Curves(names, [], [[] for _ in names])
    shown = shown_frames(values, max(points, 3 * len(names) + 2))
    known = [[None if np.isnan(x) else float(x) for x in column] for column in values[shown].T]
    return Curves(names, time_s[shown].tolist(), known)


def _spectra(take: Take, step_s: float) -> Curves:
    """Amplitude of each sensor's movement over frequency, counts, in ``SPECTRUM_POINTS`` equal bands."""
    if len(take.time_s) < 2 * SPECTRUM_POINTS or step_s <= 0:
        return Curves(take.sensors, [], [[] for _ in take.sensors])
    even = np.arange(take.time_s[0], take.time_s[-1], step_s)
    moved = np.column_stack([np.interp(even, take.time_s, column) for column in take.readings.T])
    moved = (moved - moved.mean(axis=0)) * np.hanning(len(even))[:, None]
    amplitude = np.abs(np.fft.rfft(moved, axis=0)) * 4.0 / len(even)  # a Hann window halves it
    bands = np.array_split(np.arange(1, len(amplitude)), SPECTRUM_POINTS)
    hz = np.fft.rfftfreq(len(even), step_s)
    return Curves(
        take.sensors,
        [float(hz[band].mean()) for band in bands],
        [[float(np.sqrt((column[band] ** 2).sum())) for band in bands] for column in amplitude.T],
    )
