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
from collections.abc import Sequence
from typing import Any, ClassVar

from glovecal_models.hand.bones import HAND
from glovecal_models.hand.skeleton import Quaternion, Vector
from glovecal_service.bridges.avatar_bridge import AvatarBridge
from glovecal_service.bridges.bone_turns import NO_TURN
from glovecal_service.bridges.bridge import LOOPBACK
from glovecal_service.bridges.glove_pose import GlovePose
from glovecal_service.bridges.t_pose import FingerBone

_SIDE = {"right": "r", "left": "l"}


class UnrealBridge(AvatarBridge):
    """Sends one or two hands to a Live Link source in Unreal's editor or game."""

    about = "Unreal Engine by JSONLiveLink or a Live Link source like it"
    to_set_there = "its source at the port sent to; subjects `glovecal_GLOVE`; a retargeter for the mannequin"
    units = "cm and rotations from the T-pose; Unreal's axes: left-handed, z up, the character faces y"
    when_stale = "nothing is sent"
    form = "Live Link as JSON"
    default_address = f"{LOOPBACK}:54321"
    options: ClassVar[dict[str, str]] = {
        "to": f"HOST:PORT where the Live Link source listens; default {default_address}",
    }

    def datagram(self, hand: GlovePose, bones: Sequence[FingerBone] | None) -> bytes:
        if bones is None:
            return b""
        side = _SIDE[str(hand.meaning.hand)]
        rows = [_row(f"{HAND}_{side}", -1, (0.0, 0.0, 0.0), NO_TURN)]
        for bone in bones:
            parent = 0 if bone.number == 0 else len(rows) - 1
            rows.append(_row(f"{bone.finger}_0{bone.number + 1}_{side}", parent, bone.place_mm, bone.turn))
        return json.dumps({f"glovecal_{hand.glove}": rows}).encode("ascii")


def _row(name: str, parent: int, place_mm: Vector, turn: Quaternion) -> dict[str, Any]:
    """Of a bone in Unity's axes: x, y, z there are -x, z, y in Unreal's."""
    x, y, z = (round(each / 10.0, 4) for each in place_mm)
    qw, qx, qy, qz = (round(each, 7) for each in turn)
    return {
        "Name": name, "Parent": parent,
        "Location": [-x, z, y], "Rotation": [-qx, qz, qy, qw], "Scale": [1.0, 1.0, 1.0],
    }  # fmt: skip
