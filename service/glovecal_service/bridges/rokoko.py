"""Hands in the form of Rokoko Studio's live stream, version 3: JSON in datagrams, plain or as LZ4 frames.

One actor, ``glovecal``: a body that stands in Rokoko's T-pose, with the newest fingers of both hands. Bones
have world rotations in Unity's axes (left-handed, y up, the actor faces z). Of a bone's own axes -y is along
it, -z out of its back (of the thumb, out of the nail). In Rokoko's T-pose the thumb is turned out by 30
degrees at its first bone and straight along the fingers from there; on an avatar that was bound in it every
bone points where the wearer's does. Receivers turn fingers in the world's axes: a body that another program
moves does not carry them.

``meta`` tells which gloves are live. The bones of one that is not stay where they were last. What Rokoko's
readers pass over: ``glovecal`` of the actor names glove, sequence, state and flags of the pose that has come.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from typing import ClassVar

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import PHALANGES
from glovecal_models.hand.rotations import HANDS, Handedness
from glovecal_models.hand.skeleton import Quaternion
from glovecal_service.bridges.avatar_bridge import AvatarBridge
from glovecal_service.bridges.bone_turns import NO_TURN, product
from glovecal_service.bridges.bridge import LOOPBACK, BridgeOptions
from glovecal_service.bridges.glove_pose import GlovePose
from glovecal_service.bridges.t_pose import UNITY_FINGERS, FingerBone, in_unity, thumb_in_t_pose
from glovecal_service.bridges.traffic import Traffic

ACTOR = "glovecal"
_PARTS = ("Proximal", "Medial", "Distal")
_NOMINAL_FPS = 60
"""Readers want one; they go by the time stamps."""
_HEIGHT_M, _HIP_HEIGHT_M = 1.8, 1.0
_H = math.sqrt(0.5)
_BODY: dict[str, Quaternion] = {
    "hip": NO_TURN, **dict.fromkeys(("spine", "chest", "neck", "head"), (0.0, 0.0, 0.0, 1.0)),
    "leftShoulder": (_H, 0.0, 0.0, -_H), "rightShoulder": (_H, 0.0, 0.0, _H),
    **dict.fromkeys(("leftUpLeg", "leftLeg"), (_H, 0.0, _H, 0.0)),
    **dict.fromkeys(("rightUpLeg", "rightLeg"), (_H, 0.0, -_H, 0.0)),
    **dict.fromkeys(("leftFoot", "leftToe"), (0.0, 0.0, _H, -_H)),
    **dict.fromkeys(("rightFoot", "rightToe"), (0.0, 0.0, -_H, _H)),
}  # fmt: skip
"""Of Rokoko's reference actor, from their plug-in for Blender; w, x, y, z."""
_ARM: dict[Handedness, Quaternion] = {"left": (0.5, 0.5, 0.5, -0.5), "right": (0.5, 0.5, -0.5, 0.5)}
"""As straight fingers."""
_THUMB = {hand: product(in_unity(thumb_in_t_pose(hand), hand), _ARM[hand]) for hand in HANDS}
"""A straight thumb, 45 degrees from the fingers, as ``t_pose.py`` has it."""
_AT_REST: Sequence[Quaternion] = (NO_TURN, NO_TURN, NO_TURN)
_LZ4_MAGIC, _LZ4_OPTIONS = bytes.fromhex("04224d18"), bytes.fromhex("6840")
"""Version 1, independent blocks of 64 kB at most, the size of the content."""
_LZ4_NOT_COMPRESSED = 0x80000000


class RokokoBridge(AvatarBridge):
    """Sends one or two hands to a program with a plug-in of Rokoko's."""

    about = "Rokoko's live plug-ins: Blender, Unity, Maya, Cinema 4D and programs that read their stream"
    to_set_there = (
        "its receiver on, at the port sent to; actor `glovecal`, bones of hands and fingers only; for Unity "
        "`--option lz4=yes`"
    )
    units = "world rotations of a body in T-pose; Unity's axes: left-handed, y up, the actor faces z"
    when_stale = "bones stop, `hasLeftGlove` or `hasRightGlove` is false"
    form = "Rokoko's JSON version 3"
    default_address = f"{LOOPBACK}:14043"
    options: ClassVar[dict[str, str]] = {
        "to": f"HOST:PORT where the plug-in listens; default {default_address}",
        "lz4": "yes for datagrams that are LZ4 frames, which the plug-in for Unity wants; default no",
    }

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        """Raises BadInput."""
        super().__init__(options, traffic)
        wanted = options.more.get("lz4", "no")
        if wanted not in ("yes", "no"):
            raise BadInput(f"option lz4 is {wanted!r}; give yes or no")
        self._is_lz4 = wanted == "yes"
        self._is_live: dict[Handedness, bool] = dict.fromkeys(HANDS, False)
        self._time_s = 0.0
        self._body = {name: _written(name, turn) for name, turn in _BODY.items()}
        for side in HANDS:
            arm = [f"{side}{part}" for part in ("UpperArm", "LowerArm", "Hand")]
            self._body |= {name: _written(name, _ARM[side]) for name in arm}
            self._turn(side, dict.fromkeys(PHALANGES, _AT_REST))

    def datagram(self, hand: GlovePose, bones: Sequence[FingerBone] | None) -> bytes:
        side = hand.meaning.hand
        if side is None:
            return b""
        self._is_live[side] = bones is not None
        if bones is not None:
            self._turn(side, {finger: [b.turn for b in bones if b.finger == finger] for finger in PHALANGES})
        self._time_s = max(self._time_s, hand.pose.monotonic_ns / 1e9)
        left, right = self._is_live["left"], self._is_live["right"]
        actor = {
            "name": ACTOR, "color": [255, 255, 255],
            "meta": {
                "hasGloves": left or right, "hasLeftGlove": left, "hasRightGlove": right, "hasBody": False,
                "hasFace": False,
            },
            "dimensions": {"totalHeight": _HEIGHT_M, "hipHeight": _HIP_HEIGHT_M},
            "glovecal": {
                "glove": hand.glove, "sequence": hand.pose.sequence, "state": hand.state,
                "flags": list(hand.pose.words),
            },
        }  # fmt: skip
        written = json.dumps(actor, separators=(",", ":"))[:-1]
        text = (
            f'{{"version":"3,0","fps":{_NOMINAL_FPS},"scene":{{"timestamp":{self._time_s!r},"props":[],'
            f'"actors":[{written},"body":{{{",".join(self._body.values())}}}}}]}}}}'
        ).encode("ascii")
        return lz4_frame(text) if self._is_lz4 else text

    def _turn(self, side: Handedness, fingers: dict[str, Sequence[Quaternion]]) -> None:
        """Each finger's bones, turned from the T-pose of ``t_pose.py``, each in its parent's axes."""
        for finger, turns in fingers.items():
            rest = _THUMB[side] if finger == "thumb" else _ARM[side]
            world = NO_TURN
            for part, turn in zip(_PARTS, turns, strict=True):
                world = product(world, turn)
                name = f"{side}{UNITY_FINGERS[finger]}{part}"
                self._body[name] = _written(name, product(world, rest))


def _written(name: str, turn: Quaternion) -> str:
    """A bone as JSON. Readers want a position of the hip alone."""
    w, x, y, z = turn
    height = _HIP_HEIGHT_M if name == "hip" else 0.0
    return (
        f'"{name}":{{"position":{{"x":0.0,"y":{height},"z":0.0}},'
        f'"rotation":{{"x":{x:.7f},"y":{y:.7f},"z":{z:.7f},"w":{w:.7f}}}}}'
    )


def lz4_frame(content: bytes) -> bytes:
    """``content`` (at most 64 kB) as an LZ4 frame of one block, which is kept as it is."""
    head = _LZ4_OPTIONS + len(content).to_bytes(8, "little")
    check = _xxh32_of_ten(head) >> 8 & 0xFF
    size = (len(content) | _LZ4_NOT_COMPRESSED).to_bytes(4, "little")
    return b"".join((_LZ4_MAGIC, head, bytes([check]), size, content, bytes(4)))


def _xxh32_of_ten(head: bytes) -> int:
    """XXH32 with seed 0 of ten bytes: two words, then two bytes."""
    first, second, third, fourth, fifth = 2654435761, 2246822519, 3266489917, 668265263, 374761393
    value = fifth + len(head)
    *words, low, high = struct.unpack("<IIBB", head)
    for word in words:
        value = _rolled(value + word * third, 17) * fourth
    for byte in (low, high):
        value = _rolled(value + byte * fifth, 11) * first
    value = (value ^ (value & 0xFFFFFFFF) >> 15) & 0xFFFFFFFF
    value = value * second & 0xFFFFFFFF
    value = (value ^ value >> 13) * third & 0xFFFFFFFF
    return value ^ value >> 16


def _rolled(value: int, bits: int) -> int:
    value &= 0xFFFFFFFF
    return (value << bits | value >> 32 - bits) & 0xFFFFFFFF
