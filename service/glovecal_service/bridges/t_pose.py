"""Finger bones as avatars have them: turned from the T-pose, in Unity's axes.

In the T-pose of the VRM specification fingers lie straight along the arm, the palm is down, the thumb level
and 45 degrees from the fingers; there no bone is turned, and all have the axes of the whole body. Unity's are
left-handed: y up, the avatar faces z, so the right arm lies along x and the left one against it.

    glove p, quaternion (w, v)  ->  M p, (w, -M v)      M turns over: its determinant is -1
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from glovecal_models.hand.bones import HAND, PHALANGES, HandBones
from glovecal_models.hand.rotations import Handedness
from glovecal_models.hand.skeleton import Quaternion, Vector
from glovecal_service.bridges.bone_turns import NO_TURN, inverse, moved, product

UNITY_AXES: dict[Handedness, tuple[Vector, Vector, Vector]] = {
    "right": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "left": ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
}
"""M of each hand, by rows: from the hand's frame to Unity's."""
UNITY_FINGERS = {"thumb": "Thumb", "index": "Index", "middle": "Middle", "ring": "Ring", "pinky": "Little"}


@dataclass(frozen=True)
class FingerBone:
    """Against the bone before it of its finger, or against the hand."""

    finger: str
    part: str
    turn: Quaternion
    place_mm: Vector

    @property
    def number(self) -> int:
        """0 to 2 from the palm on, of the thumb as well."""
        return PHALANGES[self.finger].index(self.part)


def finger_bones(bones: HandBones, turned: Sequence[Quaternion]) -> Iterator[FingerBone]:
    """The fifteen of a hand whose ``bones`` are turned so in their parents' frames; a palm that arches moves
    the little finger."""
    axes = UNITY_AXES[bones.skeleton.hand]
    for finger, parts in PHALANGES.items():
        rest = thumb_in_t_pose(bones.skeleton.hand) if finger == "thumb" else NO_TURN
        for part in parts:
            bone = bones.names.index(f"{finger}_{part}")
            turn, place_mm, parent = turned[bone], tuple(bones.heads_mm[bone].tolist()), bones.parents[bone]
            while parent is not None and _is_of_palm(bones.names[parent]):
                turn = product(turned[parent], turn)
                head_mm, place_mm = bones.heads_mm[parent].tolist(), moved(turned[parent], place_mm)
                place_mm = (head_mm[0] + place_mm[0], head_mm[1] + place_mm[1], head_mm[2] + place_mm[2])
                parent = bones.parents[parent]
            if parent is not None and bones.names[parent] != HAND:
                turn, place_mm = product(rest, turn), moved(rest, place_mm)
            turn = in_unity(product(turn, inverse(rest)), bones.skeleton.hand)
            yield FingerBone(finger, part, turn, _by(axes, place_mm))


def in_unity(turn: Quaternion, hand: Handedness) -> Quaternion:
    """A rotation by the hand's axes, by Unity's."""
    w, *along = turn
    x, y, z = _by(UNITY_AXES[hand], along)
    return w, -x, -y, -z


def _is_of_palm(name: str) -> bool:
    """A metacarpal of a finger: avatars have none."""
    finger, _, part = name.partition("_")
    return name != HAND and part not in PHALANGES[finger]


def _by(axes: tuple[Vector, Vector, Vector], vector: Sequence[float]) -> Vector:
    x, y, z = (sum(m * v for m, v in zip(row, vector, strict=True)) for row in axes)
    return x, y, z


def thumb_in_t_pose(hand: Handedness) -> Quaternion:
    """Of its bones in the hand's frame: x along the bone, 45 degrees between fingers and side; z out of the
    nail, away from the fingers."""
    half, eighth = math.sqrt(0.5), math.pi / 8
    side = 1.0 if hand == "right" else -1.0
    return product((math.cos(eighth), 0.0, 0.0, side * math.sin(eighth)), (half, -side * half, 0.0, 0.0))
