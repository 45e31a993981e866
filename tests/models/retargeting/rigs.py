"""Skeletons as programs have them: other lengths, other axes, fingers bent and spread at rest.

Names and axes are those that the programs document; which way a finger bends about which axis is held against
what was measured on one public file of each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from glovecal_models.hand.bones import HAND, PHALANGES, HandBones
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.retargeting.rig import Rig, RigBone
from glovecal_models.hand.rotations import VIRTUAL_SHARES, Handedness
from glovecal_models.hand.skeleton import hand_skeleton

X, Y, Z = np.eye(3)


def columns(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.column_stack([x, y, z])


@dataclass(frozen=True)
class Convention:
    """A bone's axes in its segment's: x along the finger, y about which it bends, z out of its back."""

    name: Callable[[Handedness, str, str, int], str]
    """Of side, finger, part and number."""
    hand: Callable[[Handedness], str]
    axes: Mapping[Handedness, np.ndarray] | None
    """None: all bones have the world's axes at rest."""
    bends_about: Mapping[Handedness, np.ndarray]
    """Of the bone's own axes, a finger's joint."""
    at_rest_deg: Mapping[str, float]
    """How its fingers stand at rest, by joint."""
    has_tips: bool
    has_metacarpals: bool = False


STRAIGHT: Mapping[str, float] = {"T_TMC": 30.0, "TI_ABD": 45.0}
A_POSE: Mapping[str, float] = {
    "MCP": 20.0, "PIP": 12.0, "DIP": 8.0, "IM_ABD": 6.0, "MR_ABD": 5.0, "RP_ABD": 8.0,
    "T_TMC": 25.0, "TI_ABD": 30.0, "T_MCP": 12.0, "T_IP": 9.0,
}  # fmt: skip
LETTERS = {"left": "l", "right": "r"}


def rigify_name(side: Handedness, finger: str, part: str, number: int) -> str:
    return f"{'' if finger == 'thumb' else 'f_'}{finger}.{number:02d}.{LETTERS[side].upper()}"


def vrm_name(side: Handedness, finger: str, part: str, number: int) -> str:
    return side + finger.replace("pinky", "little").capitalize() + part.capitalize()


CONVENTIONS: dict[str, Convention] = {
    "mixamo": Convention(
        lambda side, finger, part, number: f"mixamorig:{side.capitalize()}Hand{finger.capitalize()}{number}",
        lambda side: f"mixamorig:{side.capitalize()}Hand",
        {side: columns(Z, X, Y) for side in ("left", "right")},
        dict.fromkeys(("left", "right"), Z), STRAIGHT, has_tips=True,
    ),
    "unreal": Convention(
        lambda side, finger, part, number: f"{finger}_{number:02d}_{LETTERS[side]}",
        lambda side: f"hand_{LETTERS[side]}",
        {"left": columns(X, -Z, Y), "right": columns(-X, Z, Y)},
        dict.fromkeys(("left", "right"), Z), A_POSE, has_tips=False, has_metacarpals=True,
    ),
    "rigify": Convention(
        rigify_name,
        lambda side: f"hand.{LETTERS[side].upper()}",
        {side: columns(Y, X, -Z) for side in ("left", "right")},
        dict.fromkeys(("left", "right"), X), A_POSE, has_tips=True,
    ),
    "vrm": Convention(
        vrm_name,
        lambda side: f"{side}Hand", None, {"left": -Z, "right": Z}, STRAIGHT, has_tips=False,
    ),
    "mano": Convention(
        lambda side, finger, part, number: f"{side}_{finger}{number}",
        lambda side: f"{side}_wrist", None, {"left": -Z, "right": Z}, A_POSE, has_tips=False,
    ),
}  # fmt: skip
LENGTHS_MM = {
    "hand_length": 205.0,
    "I_proximal": 40.0,
    "M_proximal": 46.0,
    "T_metacarpal": 41.0,
    "P_distal": 25.0,
}
TO_WORLD: Mapping[Handedness, np.ndarray] = {
    "right": columns(-X, Z, Y),
    "left": columns(X, -Z, Y),
}
"""The hand's axes where fingers point to the side, thumbs forward, backs up: y is up, z forward."""


def angles_of(bones: HandBones, by_joint: Mapping[str, float]) -> np.ndarray:
    """(1, R); ``MCP`` means every finger's but the thumb's, which turns about its length by its rule."""
    names = bones.skeleton.rotations
    angles = np.zeros((1, len(names)))
    for number, name in enumerate(names):
        general = None if name.startswith("T_") else by_joint.get(name.partition("_")[2])
        angles[0, number] = by_joint.get(name, general or 0.0)
    for name, share in VIRTUAL_SHARES.items():
        angles[0, names.index("T_VIR")] += share * angles[0, names.index(name)]
    return angles


def rig_like(convention: Convention, hand: Handedness, unit_mm: float = 10.0, swing_deg: float = 0.0) -> Rig:
    """The hand of a rig: other lengths than the glove's, an arm before it; ``swing_deg``: the arm hangs."""
    bones = HandBones.of(hand_skeleton(HandDimensions.from_measured(LENGTHS_MM), hand))
    angles = angles_of(bones, convention.at_rest_deg)
    to_world = (
        Rotation.from_euler("z", swing_deg * (-1 if hand == "left" else 1), degrees=True).as_matrix()
        @ TO_WORLD[hand]
    )
    shoulder = np.array([0.0, 1400.0, 0.0])
    places = (shoulder + bones.posed(angles)[1][0] @ to_world.T) / unit_mm
    segments = to_world @ bones.orientations(angles)[0]
    arm = f"{LETTERS[hand]}_forearm_bone"
    made = [RigBone("root", None, (0.0, 0.0, 0.0), np.eye(3))]
    made.append(RigBone(arm, "root", tuple(shoulder / unit_mm), to_world))
    names = {}
    for number, own in enumerate(bones.names):
        finger, _, part = own.partition("_")
        parent = bones.parents[number]
        above = arm if parent is None else names[bones.names[parent]]
        if own == HAND:
            name = convention.hand(hand)
        else:
            place = PHALANGES[finger].index(part)
            name = convention.name(hand, finger, part, place + 1)
            if convention.has_metacarpals and place == 0 and finger != "thumb":
                base = places[0, 0] + 0.3 * (places[number, 0] - places[0, 0])
                palm = f"{finger}_metacarpal_{LETTERS[hand]}"
                made.append(RigBone(palm, above, tuple(base), segments[0]))
                above = palm
        axes = np.eye(3) if convention.axes is None else segments[number] @ convention.axes[hand]
        tail = tuple(places[number, 1]) if convention.has_tips and part in ("distal",) else None
        made.append(RigBone(name, above, tuple(places[number, 0]), axes, tail))
        names[own] = name
    return Rig(tuple(made))
