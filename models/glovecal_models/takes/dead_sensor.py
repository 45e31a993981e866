"""Sensors that say nothing of the hand: still, trembling by one count, or pressed against an end stop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.takes.take import Take

FEWEST_FRAMES = 20
"""With fewer, two values or a repeated end say nothing."""
MOSTLY = 0.8
"""Share of the frames at one end of the range from which on a sensor is clipped."""
MOVES_MEANWHILE = 0.5
"""Share of its joint's range through which the reference goes while the sensor stays at its end; without a
reference, share of those frames in which another sensor changes. Less, and the hand rested."""


@dataclass(frozen=True)
class DeadSensor:
    """``why``: "always 7", "only 7 or 8", or "at its end stop 255 in 93 % of the frames"."""

    sensor: str
    why: str

    def __str__(self) -> str:
        return f"{self.sensor} ({self.why})"


def dead_sensors(takes: Sequence[Take], sensors: Sequence[str]) -> tuple[DeadSensor, ...]:
    """Those of ``sensors`` that are dead or clipped over all takes; every take has them all."""
    columns = {name: np.concatenate([_column(take, name) for take in takes]) for name in sensors}
    steps = [np.diff(np.unique(values)) for values in columns.values()]
    count = min((float(step.min()) for step in steps if len(step)), default=0.0)
    found = ((name, _why(name, values, takes, count)) for name, values in columns.items())
    return tuple(DeadSensor(name, why) for name, why in found if why is not None)


def _why(name: str, values: np.ndarray, takes: Sequence[Take], count: float) -> str | None:
    low, high = float(values.min()), float(values.max())
    if low == high:
        return f"always {low + 0.0:g}"
    if len(values) < FEWEST_FRAMES:
        return None
    if high - low <= count:
        return f"only {low + 0.0:g} or {high + 0.0:g}"
    end = high if np.mean(values == high) > np.mean(values == low) else low
    share = float(np.mean(values == end))
    if share < MOSTLY or not _moves_meanwhile(name, takes, end):
        return None
    return f"at its end stop {end + 0.0:g} in {100 * share:.0f} % of the frames"


def _moves_meanwhile(name: str, takes: Sequence[Take], end: float) -> bool:
    angles = np.concatenate([take.reference_at_frames([name])[:, 0] for take in takes])
    at_end = np.concatenate([_column(take, name) == end for take in takes])
    known = np.isfinite(angles)
    if (known & at_end).any():
        return bool(np.ptp(angles[known & at_end]) > MOVES_MEANWHILE * np.ptp(angles[known]))
    others = np.concatenate([_others_change(take, name) for take in takes])
    return bool(others[at_end].mean() > MOVES_MEANWHILE)


def _others_change(take: Take, name: str) -> np.ndarray:
    """(N,) whether any other sensor reads something else than in the frame before."""
    rest = np.delete(take.readings, take.sensors.index(name), axis=1)
    return np.append(False, (np.diff(rest, axis=0) != 0).any(axis=1))[: len(rest)]


def _column(take: Take, name: str) -> np.ndarray:
    return take.readings[:, take.sensors.index(name)]
