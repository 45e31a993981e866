"""The stretches of time where a model is worst: where to look in a recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.residuals import Residuals, TakeResiduals

STRETCH_S = 1.0
MOST = 5


@dataclass(frozen=True)
class Stretch:
    """One stretch of a take; errors over the rotations measured in it, degrees."""

    take: str
    start_s: float
    end_s: float
    """Seconds on the take's own clock."""
    rmse_deg: float
    rotation: str
    """The rotation that is worst in it."""
    rotation_rmse_deg: float
    pose: str
    """What the take calls the pose in its middle, "" for nothing."""


def worst_stretches(found: Residuals, most: int = MOST) -> tuple[Stretch, ...]:
    """Up to ``most`` stretches of about a second that do not overlap, worst first."""
    candidates = [stretch for item in found.takes for stretch in _stretches(item, found.rotations)]
    candidates.sort(key=lambda stretch: -stretch.rmse_deg)
    chosen: list[Stretch] = []
    for stretch in candidates:
        if len(chosen) == most:
            break
        if all(
            stretch.take != other.take or stretch.end_s <= other.start_s or stretch.start_s >= other.end_s
            for other in chosen
        ):
            chosen.append(stretch)
    return tuple(chosen)


def windows(time: np.ndarray, length_s: float) -> Iterator[slice]:
    """Frames of windows that overlap by half; the last one ends with the recording, so that none is short."""
    if not len(time):
        return
    last = max(float(time[-1]) - length_s, float(time[0]))
    for begin in (*np.arange(time[0], last, 0.5 * length_s), last):
        first, end = np.searchsorted(time, [begin, begin + length_s])
        if end > first:
            yield slice(int(first), int(end))


def _stretches(item: TakeResiduals, rotations: tuple[str, ...]) -> list[Stretch]:
    """Stretches that overlap by half."""
    time, squared = item.take.time_s, item.error**2
    found = []
    for rows in windows(time, STRETCH_S):
        part = squared[rows]
        counted = np.isfinite(part)
        if not counted.any():
            continue
        each = np.where(counted, part, 0.0).sum(axis=0) / np.maximum(counted.sum(axis=0), 1)
        worst = int(np.argmax(each))
        middle = (rows.start + rows.stop - 1) // 2
        found.append(
            Stretch(
                take=item.take.name,
                start_s=float(time[rows.start]),
                end_s=float(time[rows.stop - 1]),
                rmse_deg=float(np.sqrt(part[counted].mean())),
                rotation=rotations[worst],
                rotation_rmse_deg=float(np.sqrt(each[worst])),
                pose=item.take.poses[middle] if item.take.poses is not None else "",
            )
        )
    return found
