"""What a still hand is, and the poses that were held in a take: where the hand was still, and how long."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from glovecal_models.takes.take import Take

SHORTEST_HOLD_S = 0.4
SETTLING_S = 0.25
"""The beginning of a named pose is still on its way."""
BLOCK_S = 0.1
"""Stillness is judged on means of so long, so that noise is not taken for motion."""
STILL_SHARE = 0.05
"""Of a sensor's trained range: within it the sensor is still."""


@dataclass(frozen=True, eq=False)
class HeldPose:
    """A stretch of one take in which the hand was still."""

    take: Take
    frames: np.ndarray
    """Rows of the take."""
    name: str = ""
    """As the take named it, "" for a pose without a name."""

    @property
    def start_s(self) -> float:
        return float(self.take.time_s[self.frames[0]])

    @property
    def seconds(self) -> float:
        return float(self.take.time_s[self.frames[-1]] - self.take.time_s[self.frames[0]])

    @property
    def label(self) -> str:
        """What a person finds it by."""
        what = f"pose {self.name}" if self.name else "the pose"
        return f"{what} at {self.start_s:.1f} s of take {self.take.name}"


@dataclass(frozen=True)
class NotHeld:
    """A pose that the take names but in which the hand was not still for long enough."""

    label: str
    reason: str


def held_poses(take: Take, ranges: Mapping[str, float]) -> tuple[list[HeldPose], list[NotHeld]]:
    """The poses of a take, in the order of time; ``ranges`` is each sensor's trained range, in readings.

    In a take with pose names each name's run is one pose; otherwise every still stretch is.
    """
    if take.poses is None or not any(take.poses):
        stretches = _still_stretches(take, np.arange(len(take.time_s)), ranges)
        return [HeldPose(take, frames) for frames in stretches], []
    found, missed = [], []
    for name, run in _named_runs(take.poses):
        settled = run[take.time_s[run] >= take.time_s[run[0]] + SETTLING_S]
        stretches = _still_stretches(take, settled, ranges) if len(settled) else []
        if stretches:
            found.append(HeldPose(take, max(stretches, key=len), name))
        else:
            label = f"pose {name} at {take.time_s[run[0]]:.1f} s of take {take.name}"
            moving = _most_moving(take, run, ranges)
            missed.append(NotHeld(label, f"not held still for {SHORTEST_HOLD_S:g} s ({moving})"))
    return found, missed


def block_means(time_s: np.ndarray, readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means (B, S) of ``readings`` (N, S) over ``BLOCK_S`` each, and the first row of each block (B,)."""
    number = ((time_s - time_s[0]) / BLOCK_S).astype(int)
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    counts = np.diff(starts, append=len(number))
    return np.add.reduceat(readings, starts, axis=0) / counts[:, None], starts


def _named_runs(poses: tuple[str, ...]) -> list[tuple[str, np.ndarray]]:
    names = np.array(poses, dtype=object)
    edges = np.flatnonzero(names[1:] != names[:-1]) + 1
    pieces = np.split(np.arange(len(names)), edges)
    return [(str(names[piece[0]]), piece) for piece in pieces if names[piece[0]]]


def _still_stretches(take: Take, frames: np.ndarray, ranges: Mapping[str, float]) -> list[np.ndarray]:
    """Stretches within ``frames`` in which no sensor leaves a small share of its range, longest possible."""
    share, starts = _block_shares(take, frames, ranges)
    if share is None:
        return []
    stretches, begin = [], 0
    while begin < len(share):
        low = high = share[begin]
        end = begin + 1
        while end < len(share):
            low, high = np.minimum(low, share[end]), np.maximum(high, share[end])
            if (high - low).max() > STILL_SHARE:
                break
            end += 1
        rows = frames[starts[begin] : starts[end] if end < len(share) else len(frames)]
        if take.time_s[rows[-1]] - take.time_s[rows[0]] >= SHORTEST_HOLD_S:
            stretches.append(rows)
            begin = end
        else:
            begin += 1
    return stretches


def _block_shares(
    take: Take, frames: np.ndarray, ranges: Mapping[str, float]
) -> tuple[np.ndarray | None, np.ndarray]:
    """Block means (B, S) as shares of each sensor's range, and the first of ``frames`` in each block."""
    sensors = [name for name in take.sensors if ranges.get(name, 0.0) > 0]
    if len(frames) < 2 or not sensors:
        return None, np.empty(0, int)
    readings = take.readings[frames][:, [take.sensors.index(name) for name in sensors]]
    means, starts = block_means(take.time_s[frames], readings)
    return means / np.array([ranges[name] for name in sensors]), starts


def _most_moving(take: Take, frames: np.ndarray, ranges: Mapping[str, float]) -> str:
    share, _ = _block_shares(take, frames, ranges)
    if share is None:
        return "too few frames"
    sensors = [name for name in take.sensors if ranges.get(name, 0.0) > 0]
    moved = np.ptp(share, axis=0)
    worst = int(np.argmax(moved))
    return f"{sensors[worst]} moves through {100 * moved[worst]:.0f} % of its range"
