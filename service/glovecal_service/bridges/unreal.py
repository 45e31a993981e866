"""Hands for Unreal Engine as JSON in datagrams, of the form that JSONLiveLink reads.

    {"glovecal_right": [{"Name", "Parent", "Location", "Rotation", "Scale"}, ...]}

A subject a glove; the receiver fixes its bones by the first message, so all are in each. Names are those of
Unreal's mannequin (``hand_r``, ``index_01_r``), ``Parent`` is a place in the list, -1 for the hand. Locations
are cm in the parent's frame, rotations local quaternions x, y, z, w. Unreal's axes are left-handed, z up; the
character faces y, and in the T-pose (straight fingers, palm down, thumb level and 45 degrees from them) every
bone's axes are those of the character: the mannequin, whose bones rest otherwise, needs a retargeter.

While poses are stale or uncalibrated nothing is sent; a bone whose angle is not usable keeps still.
"""

from __future__ import annotations

import json
from types import TracebackType
from typing import Any, ClassVar

from glovecal_models.hand.bones import HAND, PHALANGES
from glovecal_models.hand.skeleton import Quaternion, Vector
from glovecal_service.bridges.bone_turns import NO_TURN
from glovecal_service.bridges.bridge import LOOPBACK, Bridge, BridgeOptions
from glovecal_service.bridges.datagrams import DatagramSender
from glovecal_service.bridges.glove_pose import BonesInMotion, GlovePose
from glovecal_service.bridges.t_pose import finger_bones
from glovecal_service.bridges.traffic import Traffic

DEFAULT_ADDRESS = f"{LOOPBACK}:54321"
_SIDE = {"right": "r", "left": "l"}


class UnrealBridge(Bridge):
    """Sends one or two hands to a Live Link source in Unreal's editor or game."""

    about = "Unreal Engine by JSONLiveLink or a Live Link source like it"
    to_set_there = "its source at the port sent to; subjects `glovecal_GLOVE`; a retargeter for the mannequin"
    units = "cm and rotations from the T-pose; Unreal's axes: left-handed, z up, the character faces y"
    when_stale = "nothing is sent"
    options: ClassVar[dict[str, str]] = {
        "to": f"HOST:PORT where the Live Link source listens; default {DEFAULT_ADDRESS}",
    }

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        super().__init__(options, traffic)
        self._host, self._port = options.address(DEFAULT_ADDRESS)
        self._sender: DatagramSender | None = None
        self._motions: dict[str, BonesInMotion] = {}

    @property
    def where(self) -> str:
        return f"Live Link as JSON to {self._host}:{self._port}."

    def send(self, hand: GlovePose) -> None:
        if hand.state != "live" or self._sender is None:
            return
        document = self._subject(hand)
        if document is not None and self._sender.send(json.dumps(document).encode("ascii")):
            self._traffic.note_departure(hand)
        else:
            self._traffic.note_left_out(hand.glove)

    def _subject(self, hand: GlovePose) -> dict[str, Any] | None:
        """None where it is not known which hand the glove is on."""
        posture = self._motions.setdefault(hand.glove, BonesInMotion()).turned(hand)
        if posture is None or hand.meaning.hand is None:
            return None
        side = _SIDE[hand.meaning.hand]
        rows = [_row(f"{HAND}_{side}", -1, (0.0, 0.0, 0.0), NO_TURN)]
        for bone in finger_bones(*posture):
            number = PHALANGES[bone.finger].index(bone.part)
            parent = 0 if number == 0 else len(rows) - 1
            rows.append(_row(f"{bone.finger}_0{number + 1}_{side}", parent, bone.place_mm, bone.turn))
        return {f"glovecal_{hand.glove}": rows}

    def __enter__(self) -> UnrealBridge:
        self._sender = DatagramSender(self._host, self._port)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._sender is not None:
            self._sender.close()
            self._sender = None


def _row(name: str, parent: int, place_mm: Vector, turn: Quaternion) -> dict[str, Any]:
    """Of a bone in Unity's axes: x, y, z there are -x, z, y in Unreal's."""
    x, y, z = (round(each / 10.0, 4) for each in place_mm)
    qw, qx, qy, qz = (round(each, 7) for each in turn)
    return {
        "Name": name, "Parent": parent,
        "Location": [-x, z, y], "Rotation": [-qx, qz, qy, qw], "Scale": [1.0, 1.0, 1.0],
    }  # fmt: skip
