"""Fingers for avatars by the Virtual Motion Capture protocol: OSC in datagrams, Unity's axes and bone names.

An assistant in the protocol's words: it adds fingers to a body that another program moves. Each bone's
rotation is local, and none in the T-pose (``t_pose.py``). Positions are 0: an avatar keeps its own sizes.

``/VMC/Ext/OK`` says tracking 1 while every glove is live and each of its angles usable, else 0. While poses
are stale or uncalibrated it comes alone, without bones; a bone whose angle is not usable keeps still.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import ClassVar

from glovecal_service.bridges.avatar_bridge import AvatarBridge
from glovecal_service.bridges.bridge import LOOPBACK, BridgeOptions
from glovecal_service.bridges.glove_pose import GlovePose
from glovecal_service.bridges.t_pose import UNITY_FINGERS, FingerBone
from glovecal_service.bridges.traffic import Traffic

_UNITY_PARTS = ("Proximal", "Intermediate", "Distal")
_LOADED, _CALIBRATED, _NORMAL_MODE = 1, 3, 0


class VmcBridge(AvatarBridge):
    """Sends the fingers of one or two hands to a program that shows an avatar."""

    about = "avatars: Unity, Warudo, VSeeFace, VMagicMirror, Unreal with VMC plug-ins"
    to_set_there = "its VMC receiver on, at the port sent to; in EVMC4U *Bone Position Synchronize* off"
    units = "rotations from the T-pose; Unity's axes: left-handed, y up, the avatar faces z"
    when_stale = "bones stop, /VMC/Ext/OK says tracking 0"
    form = "VMC by OSC"
    default_address = f"{LOOPBACK}:39540"
    options: ClassVar[dict[str, str]] = {
        "to": f"HOST:PORT where the avatar's program listens for VMC; default {default_address}",
    }

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        super().__init__(options, traffic)
        self._is_sound: dict[str, bool] = {}

    def datagram(self, hand: GlovePose, bones: Sequence[FingerBone] | None) -> bytes:
        self._is_sound[hand.glove] = bones is not None and bool(hand.pose.usable.all())
        tracking = int(all(self._is_sound.values()))
        messages = [_message("/VMC/Ext/OK", "iiii", _LOADED, _CALIBRATED, _NORMAL_MODE, tracking)]
        if bones is not None:
            messages.append(_message("/VMC/Ext/T", "f", hand.pose.monotonic_ns / 1e9))
            messages += [
                _message("/VMC/Ext/Bone/Pos", "sfffffff", _unity_name(hand, bone), *_turned(bone))
                for bone in bones
            ]
        return _bundle(messages)


def _unity_name(hand: GlovePose, bone: FingerBone) -> str:
    hand_name = str(hand.meaning.hand).capitalize()
    return f"{hand_name}{UNITY_FINGERS[bone.finger]}{_UNITY_PARTS[bone.number]}"


def _turned(bone: FingerBone) -> tuple[float, ...]:
    """No position, then the quaternion as x, y, z, w."""
    w, x, y, z = bone.turn
    return 0.0, 0.0, 0.0, x, y, z, w


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
