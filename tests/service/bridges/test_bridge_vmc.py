"""The VMC bridge, parsed by python-osc: names, signs of both hands, and where an avatar's fingers point."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from bridge_support import FIST, Stage, WornHand, running_bridge
from datagram_reader import datagrams, first
from pythonosc.osc_bundle import OscBundle
from realtime_support import eventually
from scipy.spatial.transform import Rotation
from unity_hands import in_unity

from glovecal_client.wire.pose import RotationFlag
from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import PHALANGES
from glovecal_models.hand.rotations import Handedness
from glovecal_service.bridges.bridge import BridgeOptions
from glovecal_service.bridges.traffic import Traffic
from glovecal_service.bridges.vmc import VmcBridge

CHAINS = {
    finger: tuple(f"{name}{part}" for part in ("Proximal", "Intermediate", "Distal"))
    for finger, name in zip(PHALANGES, ("Thumb", "Index", "Middle", "Ring", "Little"), strict=True)
}


def read(datagram: bytes) -> dict[str, Any]:
    """Rotations by bone, and arguments by address."""
    found: dict[str, Any] = {"bones": {}}
    for message in OscBundle(datagram):
        name, *values = message.params
        if message.address == "/VMC/Ext/Bone/Pos":
            assert values[:3] == [0.0, 0.0, 0.0]
            found["bones"][name] = Rotation.from_quat(values[3:])
        else:
            found[message.address] = message.params
    return found


def hand_of(
    receive: Callable[[], bytes], hand: Handedness, is_wanted: Callable[[dict[str, Any]], bool]
) -> Any:
    def wanted(datagram: bytes) -> dict[str, Any] | None:
        found = read(datagram)
        is_this = any(name.startswith(hand.capitalize()) for name in found["bones"])
        return found if is_this and is_wanted(found) else None

    return first(receive, wanted, f"the {hand} hand")


SIGNS: list[tuple[Handedness, str, str, list[int]]] = [
    ("right", "I_PIP", "IndexIntermediate", [0, 0, -1]),
    ("left", "I_PIP", "IndexIntermediate", [0, 0, 1]),
    ("right", "P_MCP", "LittleProximal", [0, 0, -1]),
    ("left", "R_DIP", "RingDistal", [0, 0, 1]),
    ("right", "IM_ABD", "IndexProximal", [0, -1, 0]),
    ("left", "IM_ABD", "IndexProximal", [0, 1, 0]),
    ("right", "MR_ABD", "RingProximal", [0, 1, 0]),
    ("right", "T_IP", "ThumbDistal", [0, 1, 0]),
    ("left", "T_IP", "ThumbDistal", [0, -1, 0]),
    ("right", "T_MCP", "ThumbIntermediate", [0, 1, 0]),
    ("left", "T_MCP", "ThumbIntermediate", [0, -1, 0]),
]


def test_each_rotation_turns_its_bone_the_way_unity_wants(stage: Stage) -> None:
    with datagrams() as (address, receive), running_bridge(stage, "vmc", "--to", address):
        for hand, rotation, bone, axis in SIGNS:
            stage.show(**{hand: {"angles": {rotation: 30.0}}})
            name = f"{hand.capitalize()}{bone}"
            expected = np.radians(30.0) * np.array(axis)

            def is_turned(found: dict[str, Any], name: str = name, expected: np.ndarray = expected) -> bool:
                return np.allclose(found["bones"][name].as_rotvec(), expected, atol=1e-6)

            found = hand_of(receive, hand, is_turned)
            assert len(found["bones"]) == 15
            straight = [each for each in found["bones"] if "Thumb" not in each and each != name]
            followers = (
                {"RightRingProximal": ["RightLittleProximal"]}.get(name, []) if rotation == "MR_ABD" else []
            )
            for other in set(straight) - set(followers):
                assert found["bones"][other].magnitude() < 1e-6, (rotation, other)


def pointing(bones: dict[str, Rotation], hand: Handedness, finger: str) -> list[np.ndarray]:
    """Directions of an avatar's finger bones in Unity, its hand in T-pose."""
    side = 1.0 if hand == "right" else -1.0
    rest = np.array([side, 0.0, 1.0]) / np.sqrt(2.0) if finger == "thumb" else np.array([side, 0.0, 0.0])
    found, carrier = [], Rotation.identity()
    for part in CHAINS[finger]:
        carrier = carrier * bones[f"{hand.capitalize()}{part}"]
        found.append(carrier.apply(rest))
    return found


def require_directions(found: dict[str, Any], worn: WornHand, angles: dict[str, float]) -> None:
    expected = in_unity(worn, angles)
    for finger in PHALANGES:
        for number, direction in enumerate(pointing(found["bones"], worn.hand, finger)):
            ours, _ = expected[finger, number]
            assert np.degrees(np.linalg.norm(direction - ours)) < 1e-4, (finger, number)


def test_an_avatars_fingers_point_where_the_hands_do(stage: Stage) -> None:
    left = {"T_TMC": 30.0, "TI_ABD": 40.0, "IM_ABD": 20.0, "R_MCP": 50.0, "MR_ABD": 10.0, "W_FLEX": 25.0}
    stage.show(right={"angles": FIST}, left={"angles": left})
    with datagrams() as (address, receive), running_bridge(stage, "vmc", "--to", address):
        require_directions(hand_of(receive, "right", lambda _: True), stage.right, FIST)
        require_directions(hand_of(receive, "left", lambda _: True), stage.left, left)
        both = hand_of(receive, "right", lambda each: each["/VMC/Ext/OK"][-1] == 1)
        assert both["/VMC/Ext/OK"] == [1, 3, 0, 1]


def test_uncertain_fingers_keep_still_and_stale_hands_send_no_bones(stage: Stage) -> None:
    stage.show(right={"angles": FIST})
    with datagrams() as (address, receive), running_bridge(stage, "vmc", "--to", address) as bridge:
        hand_of(receive, "right", lambda each: each["/VMC/Ext/OK"][-1] == 1)
        unsure = {"I_PIP": int(RotationFlag.TOO_UNCERTAIN)}
        stage.show(right={"angles": {**FIST, "I_PIP": 10.0, "M_PIP": 5.0}, "rotation_flags": unsure})
        found = hand_of(receive, "right", lambda each: each["/VMC/Ext/OK"][-1] == 0)
        require_directions(found, stage.right, {**FIST, "M_PIP": 5.0})
        stage.show(right=None)
        silent = first(receive, lambda got: None if (each := read(got))["bones"] else each, "no bones")
        assert silent["/VMC/Ext/OK"] == [1, 3, 0, 0]
        summary = bridge.end()
    assert summary["gloves"]["right"]["left_out"] == 0


def test_a_glove_of_an_unknown_hand_shows_no_bones_and_says_what_to_do(stage: Stage) -> None:
    stage.right.is_hand_known = False
    stage.show(right={"angles": FIST})
    with datagrams() as (address, receive), running_bridge(stage, "vmc", "--to", address) as bridge:
        found = read(receive())
        assert (found["bones"], found["/VMC/Ext/OK"]) == ({}, [1, 3, 0, 0])
        advice = "say so: glovecal subject measure SUBJECT --hand right"
        eventually(lambda: advice in bridge.complaints, "what to do")
        eventually(lambda: bridge.counts("right").get("left_out"), "poses that are left out")
        bridge.end()


def test_an_address_that_is_none_is_refused() -> None:
    with pytest.raises(BadInput, match=r"--to '39540' is no address; give HOST:PORT, as in 127.0.0.1:39540"):
        VmcBridge(BridgeOptions("39540"), Traffic())
    nowhere = VmcBridge(BridgeOptions("no.such.host.invalid:39540"), Traffic())
    with pytest.raises(BadInput, match=r"no computer 'no.such.host.invalid' is known here"), nowhere:
        pass
    with pytest.raises(BadInput, match="bridge vmc has no option 'port'; there are to"):
        BridgeOptions(port=1).check("vmc", VmcBridge.options)
