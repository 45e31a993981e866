"""What the takes of a guided sampling teach: one sample for each pose held, one for each frame of a widget.

All frames of a hold share one error, that of the pose: a person takes a pose 2.5 degrees from where it was
last. Seventy frames of it are one sample, not seventy. Trained on frames, a process finds ten clusters of
readings that each say one angle, takes their scatter for the noise of the sensor, and bends through all ten:
that is why LMC-GPR lost to a line where a rotation was known from key poses alone. A widget holds its angle,
and the readings change: there each frame is a sample of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.layout import Layout
from glovecal_models.quick_check.held_poses import REPEAT_SD_DEG
from glovecal_models.sampling.inverse_kinematics.contact import Rod, Touch
from glovecal_models.sampling.inverse_kinematics.follow import steadied
from glovecal_models.sampling.protocol import Kind
from glovecal_models.sampling.sampled_takes import SampledTake
from glovecal_models.takes.take import Take

FK: tuple[Kind, ...] = ("fk_independent", "fk_cross_couple")


@dataclass(frozen=True)
class LabelledTake:
    take: Take
    kind: Kind
    contacts: Mapping[str, Touch | Rod] = field(default_factory=dict)
    """What tips did, by the name that the take gives its frames."""

    @classmethod
    def of(cls, sampled: SampledTake) -> LabelledTake:
        return cls.from_document(sampled.take, sampled.to_document())

    @classmethod
    def from_document(cls, take: Take, document: Mapping[str, Any]) -> LabelledTake:
        """``document``: as ``SampledTake.to_document`` makes it. Raises BadInput for an impossible rod."""
        contacts = {
            step["pose"]: contact_of(step["touches"], step["rod_mm"])
            for step in document["steps"]
            if step["touches"]
        }
        return cls(take, document["kind"], contacts)

    def in_order(self, layout: Layout) -> LabelledTake:
        """With the layout's sensors alone, in its order; the take has them all."""
        take = self.take
        columns = [take.sensors.index(name) for name in layout.sensors]
        ordered = replace(take, sensors=layout.sensors, readings=take.readings[:, columns])
        return replace(self, take=ordered)

    def frames(self, pose: str) -> np.ndarray:
        """Rows of the take that are named ``pose``, pre-roll left out."""
        names = self.take.poses or ("",) * len(self.take.time_s)
        rows = np.array([index for index, name in enumerate(names) if name == pose], dtype=int)
        return rows[rows >= self.take.pre_roll_frames]

    def steps(self) -> list[np.ndarray]:
        """Rows in which the same rotations have the same known angles, in the order of time."""
        known = self.take.reference_at_frames(self.take.rotations)
        rows = np.flatnonzero(np.isfinite(known).any(axis=1))
        if not len(rows):
            return []
        changes = (np.diff(rows) > 1) | (np.nan_to_num(np.diff(known[rows], axis=0)) != 0).any(axis=1)
        return np.split(rows, np.flatnonzero(changes) + 1)


def contact_of(touches: Sequence[str], rod_mm: float | None) -> Touch | Rod:
    """What the tips of a step do. Raises BadInput for a rod that nobody can hold."""
    first, second = touches
    tips = (first, second)
    return Touch(tips) if rod_mm is None else Rod(tips, float(rod_mm))


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
class LabelledFrames:
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


def labelled_takes(takes: Sequence[LabelledTake]) -> LabelledFrames:
    """Poses that verify the glove's place are samples too, where other takes know the angles of that pose."""
    holds = [
        _held(labelled.take, rows, _known(labelled.take, rows))
        for labelled in takes
        if labelled.kind == "fk_independent"
        for rows in labelled.steps()
    ]
    known = {held.pose: held.angles for held in holds}
    for labelled in takes:
        if labelled.kind == "verification":
            runs = [(pose, labelled.frames(pose)) for pose in known if pose]
            holds += [_held(labelled.take, rows, known[pose]) for pose, rows in runs if len(rows)]
    moved = [
        Moved(labelled.take, steadied(labelled.take.time_s, labelled.take.readings.astype(float)))
        for labelled in takes
        if labelled.kind == "fk_cross_couple"
    ]
    return LabelledFrames(tuple(holds), tuple(moved))


def hold_sd_deg(samples: LabelledFrames, layout: Layout) -> float:
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
