"""How each bone of a hand is turned in its parent's frame, as quaternions, for one frame at a time.

The same turns as those of ``HandBones.orientations``, in a fifth of its time: numpy pays for many frames, and
here comes one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.skeleton import Joint, Quaternion, Vector

NO_TURN: Quaternion = (1.0, 0.0, 0.0, 0.0)


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """First ``q``, then ``p``; all w, x, y, z."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w,
    )  # fmt: skip


def inverse(q: Quaternion) -> Quaternion:
    """Of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


def moved(q: Quaternion, vector: Vector) -> Vector:
    """``vector`` turned by ``q``."""
    _, x, y, z = product(product(q, (0.0, *vector)), inverse(q))
    return x, y, z


class BoneTurns:
    """Prepared for one hand."""

    def __init__(self, bones: HandBones) -> None:
        self.bones = bones
        places = {name: place for place, name in enumerate(bones.skeleton.rotations)}
        self._chains = [
            [_Turn(joint, places) for joint in _joints_of(bones, bone)] for bone in range(len(bones.names))
        ]

    def local(self, degrees: Sequence[float]) -> list[Quaternion]:
        """Of each bone in its parent's frame, the hand's in that of the forearm; ``degrees`` are in the order
        of the skeleton's rotations."""
        turned = []
        for chain in self._chains:
            whole = NO_TURN
            for turn in chain:
                whole = product(whole, turn.quaternion(degrees))
            turned.append(whole)
        return turned


def _joints_of(bones: HandBones, bone: int) -> list[Joint]:
    """Those that turn a bone against its parent, from the parent on."""
    skeleton, parent = bones.skeleton, bones.parents[bone]
    before = None if parent is None else bones.joints[parent]
    chain, joint = [], bones.joints[bone]
    while joint is not None and joint != before:
        chain.insert(0, skeleton.joints[joint])
        joint = skeleton.parents[joint]
    return chain


class _Turn:
    """One joint: its orientation, then a turn about its axis."""

    def __init__(self, joint: Joint, places: dict[str, int]) -> None:
        self._orientation, self._axis = joint.orientation, joint.axis
        self._weights = [(places[name], weight) for name, weight in joint.rotations.items()]

    def quaternion(self, degrees: Sequence[float]) -> Quaternion:
        half = math.radians(sum(weight * degrees[place] for place, weight in self._weights)) / 2
        sine, (x, y, z) = math.sin(half), self._axis
        turn = (math.cos(half), sine * x, sine * y, sine * z)
        return turn if self._orientation == NO_TURN else product(self._orientation, turn)
