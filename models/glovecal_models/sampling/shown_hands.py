"""Hands to be drawn beside the wearer's own, so that a step is understood before its sentence is read.

Only what a step names is exact; the rest is how most people take the pose. The wrist is left out where a step
says nothing of it.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.hand.rotations import HAND_ROTATIONS, LIMITS_DEG, REST_DEG, WRIST
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.inverse_kinematics.follow import follow
from glovecal_models.inverse_kinematics.hand_shape import HandShape
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.sampling.guided.labelled_takes import contact_of
from glovecal_models.sampling.protocol import Step

_FINGERS = "IMRP"
_THUMB_ASIDE = {"T_TMC": 5.0, "TI_ABD": 15.0, "T_MCP": 3.0, "T_IP": 3.0}
_THUMB_CLOSED = {"T_TMC": 50.0, "TI_ABD": 25.0, "T_MCP": 40.0, "T_IP": 55.0}
_AT_REST = {name: angle for name, angle in REST_DEG.items() if name not in WRIST}
_GAPS = ("IM_ABD", "MR_ABD", "RP_ABD")


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
