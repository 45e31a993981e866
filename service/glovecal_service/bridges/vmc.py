"""Fingers for avatars by the Virtual Motion Capture protocol: OSC in datagrams, Unity's axes and bone names.

An assistant in the protocol's words: it adds fingers to a body that another program moves. Each bone's
rotation is local, and none in the T-pose of the VRM specification: fingers straight along the arm, palm down,
the thumb level and 45 degrees from the fingers. Unity's axes are left-handed: y up, the avatar faces z, so
the right arm lies along x and the left one against it. Positions are 0: an avatar keeps its own sizes.

    glove p, quaternion (v, w)  ->  M p, (-M v, w)      M turns over: its determinant is -1

``/VMC/Ext/OK`` says tracking 1 while every glove is live and each of its angles usable, else 0. While poses
are stale or uncalibrated it comes alone, without bones; a bone whose angle is not usable keeps still.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import ClassVar

from glovecal_models.hand.bones import DISTAL, HAND, INTERMEDIATE, METACARPAL, PHALANGES, PROXIMAL, HandBones
from glovecal_models.hand.rotations import Handedness
from glovecal_models.hand.skeleton import Quaternion, Vector
from glovecal_service.bridges.bone_turns import NO_TURN, inverse, product
from glovecal_service.bridges.bridge import LOOPBACK, Bridge, BridgeOptions
from glovecal_service.bridges.datagrams import DatagramSender
from glovecal_service.bridges.glove_pose import BonesInMotion, GlovePose
from glovecal_service.bridges.traffic import Traffic

DEFAULT_ADDRESS = f"{LOOPBACK}:39540"
UNITY_AXES: dict[Handedness, tuple[Vector, Vector, Vector]] = {
    "right": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "left": ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
}
"""M of each hand: from the hand's frame to Unity's, the arm in T-pose."""
_UNITY_FINGERS = {"thumb": "Thumb", "index": "Index", "middle": "Middle", "ring": "Ring", "pinky": "Little"}
_UNITY_PARTS = {PROXIMAL: "Proximal", INTERMEDIATE: "Intermediate", DISTAL: "Distal"}
_THUMB_PARTS = {METACARPAL: "Proximal", PROXIMAL: "Intermediate", DISTAL: "Distal"}
_LOADED, _CALIBRATED, _NORMAL_MODE = 1, 3, 0


class VmcBridge(Bridge):
    """Sends the fingers of one or two hands to a program that shows an avatar."""

    about = "avatars: Unity, Warudo, VSeeFace, VMagicMirror, Unreal with VMC plug-ins"
    to_set_there = "its VMC receiver on, at the port sent to; in EVMC4U *Bone Position Synchronize* off"
    units = "rotations from the T-pose; Unity's axes: left-handed, y up, the avatar faces z"
    when_stale = "bones stop, /VMC/Ext/OK says tracking 0"
    options: ClassVar[dict[str, str]] = {
        "to": f"HOST:PORT where the avatar's program listens for VMC; default {DEFAULT_ADDRESS}",
    }

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        super().__init__(options, traffic)
        self._host, self._port = options.address(DEFAULT_ADDRESS)
        self._sender: DatagramSender | None = None
        self._motions: dict[str, BonesInMotion] = {}
        self._is_sound: dict[str, bool] = {}

    @property
    def where(self) -> str:
        return f"VMC by OSC to {self._host}:{self._port}."

    def send(self, hand: GlovePose) -> None:
        if self._sender is None:
            return
        motion = self._motions.setdefault(hand.glove, BonesInMotion())
        moved = motion.turned(hand) if hand.state == "live" else None
        self._is_sound[hand.glove] = moved is not None and bool(hand.usable.all())
        tracking = int(all(self._is_sound.values()))
        messages = [_message("/VMC/Ext/OK", "iiii", _LOADED, _CALIBRATED, _NORMAL_MODE, tracking)]
        if moved is not None:
            messages.append(_message("/VMC/Ext/T", "f", hand.pose.monotonic_ns / 1e9))
            messages += [
                _message("/VMC/Ext/Bone/Pos", "sfffffff", name, 0.0, 0.0, 0.0, *quaternion)
                for name, quaternion in unity_fingers(*moved)
            ]
        if not self._sender.send(_bundle(messages)) or (moved is None and hand.state == "live"):
            self._traffic.note_left_out(hand.glove)
        else:
            self._traffic.note_departure(hand)

    def __enter__(self) -> VmcBridge:
        self._sender = DatagramSender(self._host, self._port)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._sender is not None:
            self._sender.close()
            self._sender = None


def unity_fingers(
    bones: HandBones, turned: Sequence[Quaternion]
) -> Iterator[tuple[str, tuple[float, float, float, float]]]:
    """Unity's name and local rotation (x, y, z, w) of each finger bone, of bones turned in their parents'
    frames."""
    hand = bones.skeleton.hand
    for finger, parts in PHALANGES.items():
        rest = thumb_in_t_pose(hand) if finger == "thumb" else NO_TURN
        for part in parts:
            bone = bones.names.index(f"{finger}_{part}")
            local, carrier = turned[bone], bones.parents[bone]
            if carrier is not None and bones.names[carrier] == "pinky_metacarpal":  # Unity has none
                local, carrier = product(turned[carrier], local), bones.parents[carrier]
            if carrier is not None and bones.names[carrier] != HAND:
                local = product(rest, local)
            w, *along = product(local, inverse(rest))
            x, y, z = (-sum(m * v for m, v in zip(row, along, strict=True)) for row in UNITY_AXES[hand])
            names = _THUMB_PARTS if finger == "thumb" else _UNITY_PARTS
            yield f"{hand.capitalize()}{_UNITY_FINGERS[finger]}{names[part]}", (x, y, z, w)


def thumb_in_t_pose(hand: Handedness) -> Quaternion:
    """Of its bones in the hand's frame: x along the bone, 45 degrees between fingers and side; z out of the
    nail, away from the fingers."""
    half = math.sqrt(0.5)
    towards = half if hand == "right" else -half
    first_about_x: Quaternion = (half, -towards, 0.0, 0.0)
    return product(
        (math.cos(math.pi / 8), 0.0, 0.0, math.copysign(math.sin(math.pi / 8), towards)), first_about_x
    )


def _bundle(messages: list[bytes]) -> bytes:
    """To be used at once."""
    return (
        b"#bundle\x00"
        + struct.pack(">Q", 1)
        + b"".join(struct.pack(">i", len(each)) + each for each in messages)
    )


def _message(address: str, kinds: str, *values: float | str) -> bytes:
    parts = [_text(address), _text(f",{kinds}")]
    for kind, value in zip(kinds, values, strict=True):
        parts.append(_text(value) if isinstance(value, str) else struct.pack(f">{kind}", value))
    return b"".join(parts)


def _text(text: str) -> bytes:
    """Ended by a zero and filled up to a multiple of four."""
    encoded = text.encode("ascii") + b"\x00"
    return encoded + bytes(-len(encoded) % 4)
