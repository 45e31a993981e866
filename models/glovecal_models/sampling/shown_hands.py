"""Hands to be drawn beside the wearer's own, so that a step is understood before its sentence is read.

Only what a step names is exact; the rest is how most people take the pose. The wrist is left out where a step
says nothing of it.

The five hand shapes, and how surely each tells the angles of a hand that nobody measured.

Flat, spread, fist, and two "o": thumb with index and thumb with little finger (section 3.3.4). The paper has
an animator set the joints of each shape. Here the first three have the angles of a usual hand, a straight
finger more surely than a closed one; of an "o" only the touch is known, its angles roughly those of the
likeliest resting hand that keeps it.

What a template is fitted to: mean readings of held shapes, frames of motions, what is known of each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from glovecal_models.hand.rotations import (
    DIP_SHARE,
    FLAT_PALM_DEG,
    HAND_ROTATIONS,
    LIMITS_DEG,
    PALM,
    REST_DEG,
    WRIST,
)
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.quick_check.held_poses import OTHER_HAND_SD_DEG, REPEAT_SD_DEG
from glovecal_models.quick_check.key_poses import KEY_POSES_DEG
from glovecal_models.sampling.guided.labelled_takes import FK, LabelledTake, contact_of
from glovecal_models.sampling.inverse_kinematics.contact import Contact, Rod, TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import HandShape, follow, steadied
from glovecal_models.sampling.protocol import Step

_FINGERS = "IMRP"
_THUMB_ASIDE = {"T_TMC": 5.0, "TI_ABD": 15.0, "T_MCP": 3.0, "T_IP": 3.0}
_THUMB_CLOSED = {"T_TMC": 50.0, "TI_ABD": 25.0, "T_MCP": 40.0, "T_IP": 55.0}
_AT_REST = {name: angle for name, angle in REST_DEG.items() if name not in WRIST}
_GAPS = ("IM_ABD", "MR_ABD", "RP_ABD")
SHAPES = ("flat", "spread", "fist", "touch-I", "touch-P")
THUMB_SHAPE_SD_DEG = 10.0
"""How far a thumb is from a usual one's place in a named shape."""
PALM_SD_DEG = 5.0
"""How far a palm that lies on a table is from flat."""
CLOSED_PALM_DEG, CLOSED_PALM_SD_DEG = 10.0, 8.0
"""The arch of a fist, which nobody measured."""
MOST_FRAMES = 8
"""Of a motion, evenly in time."""
WIDGET_SD_DEG = 2.0
"""Of an angle that a widget holds."""


def _fingers(mcp_deg: float, pip_deg: float, gap_deg: float) -> dict[str, float]:
    bent = {f"{finger}_MCP": mcp_deg for finger in _FINGERS} | {
        f"{finger}_PIP": pip_deg for finger in _FINGERS
    }
    return bent | dict.fromkeys(_GAPS, gap_deg)


POSES_DEG: dict[str, dict[str, float]] = {
    "flat": _fingers(0.0, 0.0, 2.0) | _THUMB_ASIDE,
    "spread": _fingers(0.0, 0.0, 24.0) | _THUMB_ASIDE | {"TI_ABD": 60.0},
    "fist": _fingers(86.0, 95.0, 1.0) | _THUMB_CLOSED,
    "overbend": _fingers(88.0, 12.0, 3.0) | _THUMB_ASIDE,
    "ramp": _fingers(45.0, 0.0, 3.0) | _THUMB_ASIDE,
}
"""How the poses of the protocols look."""
MOVED_SHARES = (0.15, 0.7)
"""Of its active range, from where to where a joint that moves is shown."""
WIDER_DEG = 18.0
"""By how much more the finger of a touch bends in its second hand."""


def shown_hands(step: Step, skeleton: Skeleton) -> list[dict[str, float]]:
    """Degrees by rotation: one hand of a pose that is held, two between which a motion goes to and fro."""
    if step.touches:
        return _touching(step, skeleton)
    if step.motion == "hold":
        return [_AT_REST | POSES_DEG.get(step.pose, {}) | dict(step.angles)]
    if step.kind == "range":
        return [_AT_REST | POSES_DEG["spread"], _AT_REST | POSES_DEG["fist"]]
    moving = [HAND_ROTATIONS.index(name) for name in step.moves if name in HAND_ROTATIONS]
    low, high = LIMITS_DEG[moving].T
    return [
        _AT_REST
        | {HAND_ROTATIONS[column]: float(angle) for column, angle in zip(moving, at, strict=True)}
        | dict(step.angles)
        for at in (low + share * (high - low) for share in MOVED_SHARES)
    ]


def _touching(step: Step, skeleton: Skeleton) -> list[dict[str, float]]:
    """The likeliest resting hand whose tips are together, and one whose finger is bent further."""
    contact = contact_of(step.touches, step.rod_mm)
    chains = TipChains(skeleton, contact.fingers)
    rest = HandShape.at_rest(chains.rotations)
    finger = contact.fingers[1]
    further = np.array([WIDER_DEG if name == f"{finger}_MCP" else 0.0 for name in chains.rotations])
    centres = np.vstack([rest.centre_deg, rest.centre_deg + further])
    shape = HandShape(chains.rotations, centres, np.repeat(rest.sd_deg, 2, axis=0))
    found = follow(chains, contact, shape).angles_deg.tolist()
    return [_AT_REST | dict(zip(chains.rotations, angles, strict=True)) for angles in found]


class KnownAngle(NamedTuple):
    degrees: float
    sd_deg: float


def shape_angles(pose: str) -> dict[str, KnownAngle]:
    """What the name of a shape tells of a hand; nothing for another pose."""
    if pose not in KEY_POSES_DEG:
        return {}
    usual = {**POSES_DEG[pose], **KEY_POSES_DEG[pose]}
    found = {name: KnownAngle(degrees, _sd(name, degrees)) for name, degrees in usual.items()}
    for finger in "IMRP":
        bend = found[f"{finger}_PIP"]
        found[f"{finger}_DIP"] = KnownAngle(DIP_SHARE * bend.degrees, bend.sd_deg)
    closed = pose == "fist"
    palm = (CLOSED_PALM_DEG, CLOSED_PALM_SD_DEG) if closed else (FLAT_PALM_DEG, PALM_SD_DEG)
    return found | {PALM: KnownAngle(*palm)}


def _sd(rotation: str, degrees: float) -> float:
    if rotation.startswith("T"):
        return THUMB_SHAPE_SD_DEG
    return REPEAT_SD_DEG if degrees == 0.0 else OTHER_HAND_SD_DEG


def touching_angles(skeleton: Skeleton, contact: Contact) -> dict[str, KnownAngle]:
    """Of the likeliest resting hand that keeps ``contact``, as surely as a resting hand is known."""
    chains = TipChains(skeleton, contact.fingers)
    rest = HandShape.at_rest(chains.rotations)
    angles = follow(chains, contact, rest).angles_deg[0]
    return {
        name: KnownAngle(float(angle), float(sd))
        for name, angle, sd in zip(chains.rotations, angles, rest.sd_deg[0], strict=True)
    }


def merged(*sources: Mapping[str, KnownAngle]) -> dict[str, KnownAngle]:
    """The surest of what is known of each rotation."""
    found: dict[str, KnownAngle] = {}
    for source in sources:
        for name, known in source.items():
            if name not in found or known.sd_deg < found[name].sd_deg:
                found[name] = known
    return {name: known for name, known in found.items() if np.isfinite(known.degrees)}


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
