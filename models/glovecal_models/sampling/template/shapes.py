"""The five hand shapes, and how surely each tells the angles of a hand that nobody measured.

Flat, spread, fist, and two "o": thumb with index and thumb with little finger (section 3.3.4). The paper has
an animator set the joints of each shape. Here the first three have the angles of a usual hand, a straight
finger more surely than a closed one; of an "o" only the touch is known, its angles roughly those of the
likeliest resting hand that keeps it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from glovecal_models.hand.rotations import DIP_SHARE, FLAT_PALM_DEG, PALM
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.inverse_kinematics.contact import Contact
from glovecal_models.inverse_kinematics.follow import follow
from glovecal_models.inverse_kinematics.hand_shape import HandShape
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.quick_check.pose_book import KEY_POSES_DEG, OTHER_HAND_SD_DEG, REPEAT_SD_DEG
from glovecal_models.sampling.shown_hands import POSES_DEG

SHAPES = ("flat", "spread", "fist", "touch-I", "touch-P")
THUMB_SHAPE_SD_DEG = 10.0
"""How far a thumb is from a usual one's place in a named shape."""
PALM_SD_DEG = 5.0
"""How far a palm that lies on a table is from flat."""
CLOSED_PALM_DEG, CLOSED_PALM_SD_DEG = 10.0, 8.0
"""The arch of a fist, which nobody measured."""


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
