"""What takes with known angles teach: one sample for each pose that was held, one for each frame of a widget.

All frames of a hold share one error, that of the pose: a person takes a pose 2.5 degrees from where it was
last. Seventy frames of it are one sample, not seventy. Trained on frames, a process finds ten clusters of
readings that each say one angle, takes their scatter for the noise of the sensor, and bends through all ten:
that is why LMC-GPR lost to a line where a rotation was known from key poses alone.
A widget holds its angle, and the readings change: there each frame is a sample of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.inverse_kinematics.steadied import steadied
from glovecal_models.layout import Layout
from glovecal_models.quick_check.pose_book import REPEAT_SD_DEG
from glovecal_models.sampling.guided.taught_take import TaughtTake
from glovecal_models.takes.take import Take

LEAST_HOLDS = 3
SEEN_BEFORE = 2.0
"""The usual spread of poses counts as if it had been seen so often."""


@dataclass(frozen=True)
class Held:
    """One hold."""

    take: Take
    pose: str
    readings: np.ndarray
    """(S,), means, in the take's order of sensors."""
    angles: dict[str, float]
    """Degrees by rotation."""


@dataclass(frozen=True)
class Moved:
    """Frames of one take with known angles while the rest of the hand moved."""

    take: Take
    readings: np.ndarray
    """(N, S), without the sensors' noise; all frames of the take."""


@dataclass(frozen=True)
class TaughtSamples:
    holds: tuple[Held, ...]
    moved: tuple[Moved, ...]

    def of_holds(self, rotation: str, sensors: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Mean readings (N, len(sensors)) and angles (N,)."""
        own = [held for held in self.holds if rotation in held.angles]
        rows = [held.readings[[held.take.sensors.index(name) for name in sensors]] for held in own]
        angles = np.array([held.angles[rotation] for held in own])
        return np.array(rows).reshape(len(own), len(sensors)), angles

    def of_widgets(self, rotation: str, sensors: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Steadied readings (N, len(sensors)) and angles (N,)."""
        rows, angles = [np.empty((0, len(sensors)))], [np.empty(0)]
        for moved in self.moved:
            angle = moved.take.reference_at_frames([rotation])[:, 0]
            known = np.isfinite(angle)
            columns = [moved.take.sensors.index(name) for name in sensors]
            rows.append(moved.readings[known][:, columns])
            angles.append(angle[known])
        return np.concatenate(rows), np.concatenate(angles)

    @property
    def rotations(self) -> tuple[str, ...]:
        held = [name for each in self.holds for name in each.angles]
        return tuple(dict.fromkeys([*held, *(name for each in self.moved for name in each.take.rotations)]))


def taught_samples(takes: Sequence[TaughtTake]) -> TaughtSamples:
    """Poses that verify the glove's place are samples too, where other takes know the angles of that pose."""
    holds = [
        _held(taught.take, rows, _known(taught.take, rows))
        for taught in takes
        if taught.kind == "fk_independent"
        for rows in taught.steps()
    ]
    known = {held.pose: held.angles for held in holds}
    for taught in takes:
        if taught.kind == "verification":
            runs = [(pose, taught.frames(pose)) for pose in known if pose]
            holds += [_held(taught.take, rows, known[pose]) for pose, rows in runs if len(rows)]
    moved = [
        Moved(taught.take, steadied(taught.take.time_s, taught.take.readings.astype(float)))
        for taught in takes
        if taught.kind == "fk_cross_couple"
    ]
    return TaughtSamples(tuple(holds), tuple(moved))


def hold_sd_deg(samples: TaughtSamples, layout: Layout) -> float:
    """How far poses are from the angles they are said to have: the scatter about a line of the rotations that
    one sensor reads by itself. Leans on the usual spread of 2.5 degrees where little was held."""
    squared, freedom = SEEN_BEFORE * REPEAT_SD_DEG**2, SEEN_BEFORE
    for item in layout.correspondences:
        readings, angles = samples.of_holds(item.rotation, item.sensors)
        if item.kind == "1S1R" and len(angles) > LEAST_HOLDS and np.ptp(readings) > 0:
            line = np.polyfit(readings[:, 0], angles, 1)
            squared += float(np.sum((np.polyval(line, readings[:, 0]) - angles) ** 2))
            freedom += len(angles) - 2
    return float(np.sqrt(squared / freedom))


def _held(take: Take, rows: np.ndarray, angles: dict[str, float]) -> Held:
    pose = "" if take.poses is None else take.poses[int(rows[0])]
    return Held(take, pose, take.readings[rows].mean(axis=0), angles)


def _known(take: Take, rows: np.ndarray) -> dict[str, float]:
    known = take.reference_at_frames(take.rotations)[rows[0]]
    angles = zip(take.rotations, known.tolist(), strict=True)
    return {name: angle for name, angle in angles if np.isfinite(angle)}
