"""What a template is fitted to: mean readings of held shapes, frames of motions, what is known of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.inverse_kinematics.contact import Rod, Touch
from glovecal_models.inverse_kinematics.steadied import steadied
from glovecal_models.quick_check.pose_book import REPEAT_SD_DEG
from glovecal_models.sampling.guided.labelled_takes import FK, LabelledTake
from glovecal_models.sampling.template.shapes import KnownAngle, merged, shape_angles, touching_angles

MOST_FRAMES = 8
"""Of a motion, evenly in time."""
WIDGET_SD_DEG = 2.0
"""Of an angle that a widget holds."""


@dataclass(frozen=True)
class Observation:
    """Frames that share what is known of them."""

    pose: str
    readings: np.ndarray
    """(N, S), raw counts; one row for a shape that was held."""
    known: Mapping[str, KnownAngle]
    """By rotation. Its error is one for all frames, not one a frame."""
    contact: Touch | Rod | None = None


def observations(takes: Sequence[LabelledTake], skeleton: Skeleton) -> list[Observation]:
    """Of a sampling's takes: shapes held, widgets, touches; ``skeleton``: the hand that touches."""
    found: list[Observation] = []
    for labelled in takes:
        if labelled.contacts:
            found += _touches(labelled, skeleton)
        elif labelled.kind in FK and labelled.take.rotations:
            found += [_step(labelled, rows) for rows in labelled.steps()]
        elif labelled.kind == "verification":
            found += _named(labelled)
    return found


def _touches(labelled: LabelledTake, skeleton: Skeleton) -> list[Observation]:
    found = []
    for pose, contact in labelled.contacts.items():
        rows = labelled.frames(pose)
        if len(rows):
            known = touching_angles(skeleton, contact)
            found.append(Observation(pose, _some(labelled, rows), known, contact))
    return found


def _step(labelled: LabelledTake, rows: np.ndarray) -> Observation:
    take = labelled.take
    pose = "" if take.poses is None else take.poses[int(rows[0])]
    held = labelled.kind == "fk_independent"
    sd = REPEAT_SD_DEG if held else WIDGET_SD_DEG
    angles = zip(take.rotations, take.reference_at_frames(take.rotations)[rows[0]].tolist(), strict=True)
    taught = {name: KnownAngle(angle, sd) for name, angle in angles if np.isfinite(angle)}
    readings = take.readings[rows].mean(axis=0, keepdims=True) if held else _some(labelled, rows)
    return Observation(pose, readings, merged(taught, shape_angles(pose) if held else {}))


def _named(labelled: LabelledTake) -> list[Observation]:
    """Shapes that only have a name."""
    names = dict.fromkeys(name for name in labelled.take.poses or () if name)
    return [
        Observation(pose, labelled.take.readings[rows].mean(axis=0, keepdims=True), shape_angles(pose))
        for pose in names
        if shape_angles(pose) and len(rows := labelled.frames(pose))
    ]


def _some(labelled: LabelledTake, rows: np.ndarray) -> np.ndarray:
    take = labelled.take
    smooth = steadied(take.time_s[rows], take.readings[rows].astype(float))
    return smooth[np.unique(np.linspace(0, len(rows) - 1, MOST_FRAMES).round().astype(int))]
