"""The Unreal bridge, read as JSONLiveLink reads it; where fingertips come to lie by its bones alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
from bridge_support import FIST, FLAT, Stage, WornHand, running_bridge
from datagram_reader import datagrams, first
from realtime_support import eventually
from scipy.spatial.transform import Rotation

from glovecal_client.wire.pose import RotationFlag
from glovecal_models.hand.bones import HandBones
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS, Handedness

TO_UNREAL: dict[Handedness, Callable[[np.ndarray], np.ndarray]] = {
    "right": lambda p: np.array([-p[0], p[1], p[2]]),
    "left": lambda p: np.array([p[0], -p[1], p[2]]),
}
"""The arm against x or along it, the thumb's side to y, the back of the hand to z."""


def subject_of(
    receive: Callable[[], bytes], name: str, is_wanted: Callable[[list[dict[str, Any]]], bool] = bool
) -> list[dict[str, Any]]:
    def wanted(datagram: bytes) -> list[dict[str, Any]] | None:
        rows = json.loads(datagram.decode("ascii")).get(name)
        return rows if rows and is_wanted(rows) else None

    return first(receive, wanted, f"subject {name}")


def placed(rows: list[dict[str, Any]]) -> dict[str, tuple[np.ndarray, Rotation]]:
    """Place in cm and rotation of each bone, by the rows alone."""
    found: list[tuple[np.ndarray, Rotation]] = []
    for row in rows:
        at, turn = (np.zeros(3), Rotation.identity()) if row["Parent"] < 0 else found[row["Parent"]]
        local = Rotation.from_quat(row["Rotation"])
        found.append((at + turn.apply(row["Location"]), turn * local))
    return dict(zip((row["Name"] for row in rows), found, strict=True))


def require_hand(rows: list[dict[str, Any]], worn: WornHand, angles: dict[str, float]) -> None:
    """Joints in the hand's frame: the wrist is left to the body."""
    every = np.array([[{**FLAT, **angles, "W_FLEX": 0.0, "W_ABD": 0.0}[name] for name in HAND_ROTATIONS]])
    frames = forward_kinematics(worn.skeleton, every)
    bones, at = HandBones.of(worn.skeleton), placed(rows)
    side, turn = worn.hand[0], TO_UNREAL[worn.hand]
    for number, finger in enumerate(FINGERS.values()):
        for part, name in enumerate(each for each in bones.names if each.startswith(finger)):
            joint = bones.joints[bones.names.index(name)]
            place, _ = at[f"{finger}_0{part + 1}_{side}"]
            np.testing.assert_allclose(10 * place, turn(frames.joints_mm[0, joint]), atol=2e-3)
        last = [row["Name"] for row in rows if row["Name"].startswith(finger)][-1]
        place, rotation = at[last]
        rest = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0) if finger == "thumb" else np.array([1.0, 0.0, 0.0])
        along = rest * (1.0, 1.0 if side == "r" else -1.0, 1.0)
        length_mm = float(np.linalg.norm(worn.skeleton.tips[number].offset_mm))
        tip = 10 * place + length_mm * rotation.apply(turn(along))
        np.testing.assert_allclose(tip, turn(frames.tips_mm[0, number]), atol=2e-3)


def test_fingertips_lie_where_the_hands_are(stage: Stage) -> None:
    left = {"T_TMC": 30.0, "TI_ABD": 40.0, "IM_ABD": 20.0, "R_MCP": 50.0, "MR_ABD": 10.0, "W_FLEX": 25.0}
    stage.show(right={"angles": FIST}, left={"angles": left})
    with datagrams() as (address, receive), running_bridge(stage, "unreal", "--to", address) as bridge:
        rows = subject_of(receive, "glovecal_right")
        names = [f"{finger}_0{number}_r" for finger in FINGERS.values() for number in (1, 2, 3)]
        assert [row["Name"] for row in rows] == ["hand_r", *names]
        assert {tuple(row["Scale"]) for row in rows} == {(1.0, 1.0, 1.0)}
        require_hand(rows, stage.right, FIST)
        require_hand(subject_of(receive, "glovecal_left"), stage.left, left)
        unsure = {"I_PIP": int(RotationFlag.TOO_UNCERTAIN)}
        stage.show(right={"angles": {**FIST, "I_PIP": 10.0, "M_PIP": 5.0}, "rotation_flags": unsure})

        def has_moved(rows: list[dict[str, Any]]) -> bool:
            (middle,) = [row for row in rows if row["Name"] == "middle_02_r"]
            return bool(abs(middle["Rotation"][3]) > 0.99)

        moved = subject_of(receive, "glovecal_right", has_moved)
        require_hand(moved, stage.right, {**FIST, "M_PIP": 5.0})
        stage.show(right=None)
        eventually(lambda: bridge.counts("right").get("state") == "stale", "silence")
        stage.show(left={"angles": FLAT})
        subject_of(receive, "glovecal_left", lambda rows: rows[4]["Rotation"][3] == 1.0)
        for _ in range(20):
            assert set(json.loads(receive())) == {"glovecal_left"}, "nothing stale is sent"
