"""The Rokoko bridge, read by the rules of Rokoko's plug-in for Blender, written down here again: where the
fingers of an avatar point that was bound in Rokoko's T-pose."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow
import pytest
from bridge_support import FIST, FLAT, Stage, WornHand, running_bridge
from datagram_reader import datagrams, first
from scipy.spatial.transform import Rotation
from unity_hands import in_unity

from glovecal_client.wire.pose import PoseFlag, RotationFlag
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import HANDS
from glovecal_service.bridges.bridge import BridgeOptions
from glovecal_service.bridges.rokoko import RokokoBridge, lz4_frame
from glovecal_service.bridges.traffic import Traffic

FINGERS = {"thumb": "Thumb", "index": "Index", "middle": "Middle", "ring": "Ring", "pinky": "Little"}
LZ4 = bytes.fromhex("04224d18")
PARTS = ("Proximal", "Medial", "Distal")
SPREAD = {"TI_ABD": 40.0, "T_TMC": 20.0, "IM_ABD": 20.0, "MR_ABD": 15.0, "RP_ABD": 18.0, "W_FLEX": 25.0}
REFERENCES = {
    "leftHand": (-0.5, -0.5, -0.5, 0.5), "rightHand": (0.5, 0.5, -0.5, 0.5),
    "leftThumbProximal": (-0.0923, -0.56098, -0.70106, 0.43046),
    "leftThumb": (-0.2706, -0.65328, -0.65328, 0.2706),
    "rightThumbProximal": (0.0923, 0.56099, -0.70106, 0.43046),
    "rightThumb": (0.2706, 0.65328, -0.65328, 0.2706),
    "hip": (-1.0, 0.0, 0.0, 0.0), "spine": (0.0, 0.0, 0.0, -1.0),
    "leftShoulder": (-0.70711, 0.0, 0.0, 0.70711), "rightLeg": (0.70711, 0.0, -0.70711, 0.0),
    "leftFoot": (0.0, 0.0, 0.70711, -0.70711),
}  # fmt: skip
"""The plug-in's, w, x, y, z; straight fingers lie as the hand does."""


def turned(wxyz: tuple[float, ...]) -> Rotation:
    w, x, y, z = wxyz
    return Rotation.from_quat([x, y, z, w])


def reference(bone: str) -> Rotation:
    side = "left" if bone.startswith("left") else "right"
    known = bone if bone in REFERENCES else f"{side}Thumb" if "Thumb" in bone else f"{side}Hand"
    return turned(REFERENCES[known])


def actor_of(datagram: bytes) -> dict[str, Any]:
    """As ``LiveData`` of the plug-in reads it, an LZ4 frame or not: what it looks up has to be there."""
    if datagram.startswith(LZ4):
        size = int.from_bytes(datagram[6:14], "little")
        datagram = pyarrow.decompress(datagram, size, codec="lz4", asbytes=True)
    document = json.loads(datagram)
    assert int(str(document["version"]).replace(".", ",").split(",")[0]) == 3
    assert document.get("trackers") is None
    assert (document["fps"] > 0, document["scene"]["props"]) == (True, [])
    (actor,) = document["scene"]["actors"]
    assert not actor["meta"]["hasFace"]
    return actor | {"timestamp": document["scene"]["timestamp"]}


def actor_with(receive: Callable[[], bytes], is_wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    def wanted(datagram: bytes) -> dict[str, Any] | None:
        actor = actor_of(datagram)
        return actor if is_wanted(actor) else None

    return first(receive, wanted, "an actor")


def both_live(actor: dict[str, Any]) -> bool:
    return actor["meta"]["hasLeftGlove"] and actor["meta"]["hasRightGlove"]


def from_reference(actor: dict[str, Any], bone: str) -> Rotation:
    """What the plug-in turns a bone by, in the world, from where the avatar was bound."""
    new = actor["body"][bone]["rotation"]
    return turned((new["w"], new["x"], new["y"], new["z"])) * reference(bone).inv()


def require_hand(actor: dict[str, Any], worn: WornHand, angles: dict[str, float]) -> None:
    expected = in_unity(worn, angles)
    for finger, name in FINGERS.items():
        for number, part in enumerate(PARTS):
            bone = f"{worn.hand}{name}{part}"
            turn = from_reference(actor, bone)
            ours = expected[finger, number]
            for axis, direction in zip(((0, -1, 0), (0, 0, -1)), ours, strict=True):
                there = turn.apply(reference(bone).apply(axis))
                assert np.degrees(np.linalg.norm(there - direction)) < 1e-4, bone
    assert from_reference(actor, f"{worn.hand}Hand").magnitude() < 1e-6, "the wrist is left to the body"


def test_rokokos_t_pose_is_what_it_is_taken_for() -> None:
    """Bones lie along -y, out of their backs is -z: by the references alone."""
    for hand, side in (("right", 1.0), ("left", -1.0)):
        np.testing.assert_allclose(reference(f"{hand}Hand").apply([0, -1, 0]), [side, 0, 0], atol=1e-4)
        np.testing.assert_allclose(reference(f"{hand}Hand").apply([0, 0, -1]), [0, 1, 0], atol=1e-4)
        first = reference(f"{hand}ThumbProximal").apply([0, -1, 0])
        np.testing.assert_allclose(first, [side * np.sqrt(0.75), 0, 0.5], atol=1e-4)
        np.testing.assert_allclose(reference(f"{hand}ThumbDistal").apply([0, -1, 0]), [side, 0, 0], atol=1e-4)


def test_an_avatars_fingers_point_where_the_hands_do(stage: Stage) -> None:
    stage.show(right={"angles": FIST}, left={"angles": SPREAD})
    with datagrams() as (address, receive), running_bridge(stage, "rokoko", "--to", address):
        actor = actor_with(receive, both_live)
        require_hand(actor, stage.right, FIST)
        require_hand(actor, stage.left, SPREAD)
        for bone in ("hip", "spine", "leftShoulder", "rightLeg", "leftFoot"):
            still = turned(tuple(actor["body"][bone]["rotation"][each] for each in "wxyz"))
            assert (still * turned(REFERENCES[bone]).inv()).magnitude() < 1e-4, "the body stands in T-pose"
        stage.show(right={"angles": SPREAD}, left={"angles": FIST})
        is_fist = "leftMiddleMedial"
        bent = actor_with(receive, lambda each: from_reference(each, is_fist).magnitude() > 1.0)
        require_hand(bent, stage.left, FIST)
        stage.show(right={"angles": FLAT}, left={"angles": FLAT})

        def are_straight(actor: dict[str, Any]) -> bool:
            bones = [f"{hand}{name}{part}" for hand in HANDS for name in FINGERS.values() for part in PARTS]
            fingers = [bone for bone in bones if "Thumb" not in bone]
            return max(from_reference(actor, bone).magnitude() for bone in fingers) < 1e-6

        flat = actor_with(receive, are_straight)
        assert flat["timestamp"] > actor["timestamp"]
        for worn in stage.hands:
            require_hand(flat, worn, FLAT)


def test_stale_hands_are_told_and_uncertain_fingers_keep_still(stage: Stage) -> None:
    stage.show(right={"angles": FIST, "flags": PoseFlag.SIMULATED}, left={"angles": FLAT})
    options = ("--option", "lz4=yes", "--to")
    with datagrams() as (address, receive), running_bridge(stage, "rokoko", *options, address) as bridge:
        assert receive().startswith(LZ4)
        actor_with(receive, both_live)
        unsure = {"I_PIP": int(RotationFlag.TOO_UNCERTAIN)}
        stage.show(right={"angles": {**FIST, "I_PIP": 10.0, "M_PIP": 5.0}, "rotation_flags": unsure})
        moved = actor_with(receive, lambda each: from_reference(each, "rightMiddleMedial").magnitude() < 1.6)
        require_hand(moved, stage.right, {**FIST, "M_PIP": 5.0})
        stage.show(right=None)
        silent = actor_with(receive, lambda each: not each["meta"]["hasRightGlove"])
        assert silent["meta"]["hasGloves"], "the left one is live"
        require_hand(silent, stage.right, {**FIST, "M_PIP": 5.0})
        stage.show(left=None)
        both = actor_with(receive, lambda each: not each["meta"]["hasGloves"])
        assert (both["glovecal"]["glove"], both["glovecal"]["state"]) == ("left", "stale")
        assert "stale" in both["glovecal"]["flags"]
        assert bridge.end()["gloves"]["right"]["left_out"] == 0


@pytest.mark.parametrize("size", [1, 4_000, 65_000])
def test_arrow_reads_lz4_frames_and_refuses_damaged_ones(size: int) -> None:
    content = bytes(range(250)) * 260
    frame = lz4_frame(content[:size])
    assert pyarrow.decompress(frame, size, codec="lz4", asbytes=True) == content[:size]
    with pytest.raises(OSError, match="ERROR_headerChecksum"):
        pyarrow.decompress(frame[:14] + bytes([frame[14] ^ 1]) + frame[15:], size, codec="lz4")


def test_other_words_than_yes_and_no_are_refused() -> None:
    with pytest.raises(BadInput, match="option lz4 is 'maybe'; give yes or no"):
        RokokoBridge(BridgeOptions(more={"lz4": "maybe"}), Traffic())
