"""What is suspicious about reference angles, in sentences for the person who imports them.

Angles written in radians are as small as radians while the sensors move by much. A joint that moves by 3
degrees has small angles too, so the sensors decide. A strain or bend sensor that changes by its whole reading
has turned by some 50 to 900 degrees in the recordings this was tried on; the same recordings in radians give
1 to 8.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.takes.take import Take

STILL_WITHIN_DEG = 0.5
"""A whole reference that stays within this has not moved: even a held hand trembles about as much."""


def reference_warnings(take: Take) -> list[str]:
    """Sentences about a reference that can be imported but hardly teaches; none for a take without one."""
    if not take.rotations:
        return []
    who = f"Take {take.name!r}"
    warnings = []
    spans = [_span(take.reference[:, index]) for index in range(len(take.rotations))]
    if max(spans) < STILL_WITHIN_DEG:
        warnings.append(
            f"{who}: the reference never moves (no rotation changes by more than {max(spans):.2g} degrees), "
            "so it can teach one pose at most. Was the tracker frozen?"
        )
    paired = frames_with_reference(take)
    if not paired.any():
        warnings.append(
            f"{who}: no frame has a reference (frames from {take.start_s:g} to {take.time_s[-1]:g} s, "
            f"reference from {take.reference_time_s[0]:g} to {take.reference_time_s[-1]:g} s). "
            "Are the two clocks different?"
        )
    elif paired.mean() < 0.5:
        warnings.append(f"{who}: only {100 * paired.mean():.0f} % of the frames have a reference.")
    return warnings


def frames_with_reference(take: Take) -> np.ndarray:
    """(N,) whether anything was measured at each frame that was asked for; the pre-roll is not counted."""
    angles = take.reference_at_frames(take.rotations)[take.pre_roll_frames :]
    return np.any(np.isfinite(angles), axis=1)


def _span(values: np.ndarray) -> float:
    measured = values[np.isfinite(values)]
    return float(measured.max() - measured.min()) if len(measured) else 0.0


LARGEST_RADIANS = 3.5
"""A little over pi."""
LEAST_SPAN = 0.2
"""Below this even radians are a small motion (11 degrees)."""
LEAST_SENSOR_MOTION = 0.06
"""Share of a sensor's largest reading."""
MOST_PER_READING = 10.0
"""Angle spans beyond this many units per whole reading of the sensor are degrees."""
WITHOUT_EXTREMES = (0.02, 0.98)
"""Quantiles between which motion is measured: a held hand's noise reaches far at its extremes."""
FEWEST_ROWS = 30
SURE_CORRELATION = 0.5


def radians_problem(takes: Sequence[Take]) -> str | None:
    """A sentence if the reference angles of ``takes`` together look like radians, else None."""
    measured = [take for take in takes if np.isfinite(take.reference).any()]
    values = np.concatenate([np.empty(0), *(take.reference.ravel() for take in measured)])
    values = values[np.isfinite(values)]
    if not len(values) or np.abs(values).max() > LARGEST_RADIANS:
        return None
    if (values == np.round(values)).all():  # 0 for a flat hand, 1 for a fist: names of poses, not angles
        return None
    found = [item for take in measured if (item := _motion(take)) is not None]
    if not found:
        return None
    span, share, sensor = max(found)
    return (
        f"no reference angle spans more than {span:.2f} while sensor {sensor} moves by {100 * share:.0f} %"
        " of its largest reading: these look like radians. Angles are wanted in degrees; multiply by 57.2958."
    )


def _motion(take: Take) -> tuple[float, float, str] | None:
    """Largest angle span, and share and name of the sensor that moved too much for degrees; None without."""
    angles = take.reference_at_frames(take.rotations)
    rows = np.isfinite(angles).any(axis=1)
    if rows.sum() < FEWEST_ROWS:
        return None
    angles, readings = angles[rows], take.readings[rows]
    measured = np.isfinite(angles).any(axis=0)
    low, high = np.nanquantile(angles[:, measured], WITHOUT_EXTREMES, axis=0)
    span = float((high - low).max())
    largest = np.abs(readings).max(axis=0)
    low, high = np.quantile(readings, WITHOUT_EXTREMES, axis=0)
    motion = (high - low) / np.where(largest > 0, largest, 1.0)
    # a reading around zero says nothing on the sensor's range: there noise must not count as motion
    tared = (readings.min(axis=0) < 0) & (readings.max(axis=0) > 0)
    moves = motion > LEAST_SENSOR_MOTION
    moves &= ~tared | (_correlation(readings, angles[:, measured]) > SURE_CORRELATION)
    if span <= LEAST_SPAN or not moves.any():
        return None
    sensor = int(np.argmax(np.where(moves, motion, -1.0)))
    if span > MOST_PER_READING * motion[sensor]:
        return None
    return span, float(motion[sensor]), take.sensors[sensor]


def _correlation(readings: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """(S,) the largest correlation, in size, of each sensor with any rotation."""
    best = np.zeros(readings.shape[1])
    for values in angles.T:
        known = np.isfinite(values)
        x = readings[known] - readings[known].mean(axis=0)
        y = values[known] - values[known].mean()
        norm = np.linalg.norm(x, axis=0) * np.linalg.norm(y)
        size = np.abs(x.T @ y) / np.where(norm > 0, norm, 1.0)
        best = np.maximum(best, size)
    return best
