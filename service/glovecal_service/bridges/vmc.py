"""Fingers for avatars by the Virtual Motion Capture protocol: OSC in datagrams, Unity's axes and bone names.

An assistant in the protocol's words: it adds fingers to a body that another program moves. Each bone's
rotation is local, and none in the T-pose (``t_pose.py``). Positions are 0: an avatar keeps its own sizes.

``/VMC/Ext/OK`` says tracking 1 while every glove is live and each of its angles usable, else 0. While poses
are stale or uncalibrated it comes alone, without bones; a bone whose angle is not usable keeps still.
"""

from __future__ import annotations

import struct
from types import TracebackType
from typing import ClassVar

from glovecal_models.hand.bones import DISTAL, INTERMEDIATE, METACARPAL, PROXIMAL
from glovecal_service.bridges.bridge import LOOPBACK, Bridge, BridgeOptions
from glovecal_service.bridges.datagrams import DatagramSender
from glovecal_service.bridges.glove_pose import BonesInMotion, GlovePose
from glovecal_service.bridges.t_pose import FingerBone, finger_bones
from glovecal_service.bridges.traffic import Traffic

DEFAULT_ADDRESS = f"{LOOPBACK}:39540"
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
        self._is_sound[hand.glove] = moved is not None and bool(hand.pose.usable.all())
        tracking = int(all(self._is_sound.values()))
        messages = [_message("/VMC/Ext/OK", "iiii", _LOADED, _CALIBRATED, _NORMAL_MODE, tracking)]
        if moved is not None:
            messages.append(_message("/VMC/Ext/T", "f", hand.pose.monotonic_ns / 1e9))
            messages += [
                _message("/VMC/Ext/Bone/Pos", "sfffffff", _unity_name(hand, bone), *_turned(bone))
                for bone in finger_bones(*moved)
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


def _unity_name(hand: GlovePose, bone: FingerBone) -> str:
    parts = _THUMB_PARTS if bone.finger == "thumb" else _UNITY_PARTS
    return f"{str(hand.meaning.hand).capitalize()}{_UNITY_FINGERS[bone.finger]}{parts[bone.part]}"


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
