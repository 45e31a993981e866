"""A hand in MuJoCo follows a glove's poses through the teleoperator, over zenoh, and stops when it must."""

# pyright: reportAttributeAccessIssue=false, reportMissingImports=false

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lerobot_teleoperator_glovecal.joint_actions import (
    GloveNotUsable,
    JointAction,
    JointActions,
    SummedRotations,
)
from loopback import eventually, free_endpoint
from published_poses import DEGREES, HOLD_S, NAMES, POSE, Glove

from glovecal_client import Pose, PoseFlag, open_router
from glovecal_client.wire.pose import RotationFlag
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton, skeleton_document
from lerobot_teleoperator_glovecal import GlovecalTeleoperator, GlovecalTeleoperatorConfig

ACTIONS = {
    "index.pos": JointAction({"I_PIP": 1.0, "I_MCP": 0.5}, offset=10.0, low=0.0, high=50.0),
    "middle.pos": JointAction({"M_PIP": -1.0}, rest=5.0),
}
MAPPING = SummedRotations(ACTIONS)


def following(**options: Any) -> JointActions:
    actions = JointActions("right", MAPPING, **options)
    actions.begin(POSE, NAMES, False)
    return actions


def test_actions_are_mapped_limited_and_ramped_in() -> None:
    actions = following(ramp_s=2.0)
    begun = actions.at(100.0, POSE, NAMES, False)
    assert begun == {"index.pos": 10.0, "middle.pos": 5.0}
    assert actions.at(101.0, POSE, NAMES, False) == {"index.pos": 30.0, "middle.pos": -27.5}
    assert actions.at(102.0, POSE, NAMES, False) == {"index.pos": 50.0, "middle.pos": -60.0}, (
        "50 is its limit"
    )
    assert actions.at(900.0, POSE, NAMES, False) == {"index.pos": 50.0, "middle.pos": -60.0}


@given(
    steps=st.lists(
        st.tuples(st.floats(0, 0.3), st.lists(st.floats(-200, 200), min_size=3, max_size=3)), max_size=20
    )
)
def test_no_step_leaves_the_limits(steps: list[tuple[float, list[float]]]) -> None:
    actions, now_s = following(), 0.0
    for later_s, degrees in steps:
        now_s += later_s
        sent = actions.at(now_s, replace(POSE, degrees=np.array(degrees, np.float32)), NAMES, False)
        assert 0.0 <= sent["index.pos"] <= 50.0
        assert math.isfinite(sent["middle.pos"])


def flagged(name: str, flag: RotationFlag) -> Pose:
    flags = np.zeros(3, np.uint8)
    flags[NAMES.index(name)] = flag
    return replace(POSE, rotation_flags=flags)


BAD: dict[str, tuple[Pose | None, bool, str]] = {
    "silent": (None, True, "no pose of it came"),
    "late": (POSE, True, "its pose is stale"),
    "stale": (replace(POSE, flags=PoseFlag.STALE), False, "its pose is stale"),
    "uncalibrated": (replace(POSE, flags=PoseFlag.UNCALIBRATED), False, "no model is active"),
    "simulated": (replace(POSE, flags=PoseFlag.SIMULATED), False, "it is simulated"),
    "faulty": (flagged("I_PIP", RotationFlag.FAULTY_SENSOR), False, "a sensor of rotation I_PIP is faulty"),
    "uncertain": (flagged("M_PIP", RotationFlag.TOO_UNCERTAIN), False, "M_PIP is too uncertain"),
    "no number": (replace(POSE, degrees=np.array([1, np.nan, 2], np.float32)), False, "I_PIP is no number"),
    "another model": (replace(POSE, model_sha256="cd" * 32), False, "another model was made active"),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_cannot_be_trusted_is_held_then_ends_it(kind: str) -> None:
    pose, is_late, why = BAD[kind]
    actions = following(hold_s=0.2, ramp_s=0.0)
    good = actions.at(10.0, POSE, NAMES, False)
    assert actions.at(10.2, pose, NAMES, is_late) == good, "it is held"
    assert actions.at(10.21, POSE, NAMES, False) == good, "a short one is forgotten"
    assert actions.at(10.4, pose, NAMES, is_late) == good
    with pytest.raises(GloveNotUsable, match=f"glove right stopped moving the robot after 0.2 s: .*{why}"):
        actions.at(10.42, pose, NAMES, is_late)
    with pytest.raises(GloveNotUsable, match=why):
        actions.at(10.5, POSE, NAMES, False)
    actions.begin(POSE, NAMES, False)
    assert actions.at(20.0, POSE, NAMES, False) == good


@pytest.mark.parametrize("kind", [kind for kind in BAD if kind != "another model"])
def test_what_cannot_be_trusted_does_not_begin(kind: str) -> None:
    pose, is_late, why = BAD[kind]
    with pytest.raises(GloveNotUsable, match=f"glove right cannot move a robot: .*{why}"):
        JointActions("right", MAPPING).begin(pose, NAMES, is_late)


def test_flags_of_rotations_that_move_nothing_do_not_count() -> None:
    actions = JointActions("right", SummedRotations({"middle.pos": ACTIONS["middle.pos"]}), ramp_s=0.0)
    faulty = flagged("I_PIP", RotationFlag.FAULTY_SENSOR)
    actions.begin(faulty, NAMES, False)
    assert actions.at(0.0, faulty, NAMES, False) == {"middle.pos": -60.0}
    allowed = JointActions("right", MAPPING, allow_simulated=True)
    allowed.begin(replace(POSE, flags=PoseFlag.SIMULATED), NAMES, False)


def test_wrong_configurations_are_refused() -> None:
    with pytest.raises(ValueError, match="name each action"):
        SummedRotations({})
    with pytest.raises(ValueError, match="low < high, not 3 and 1"):
        JointAction({"I_PIP": 1.0}, low=3, high=1)
    with pytest.raises(ValueError, match="must be finite"):
        JointAction({"I_PIP": math.inf})
    with pytest.raises(GloveNotUsable, match=r"no rotation R_PIP, .*; it has I_MCP"):
        JointActions("right", SummedRotations({"a": JointAction({"R_PIP": 1.0})})).begin(POSE, NAMES, False)


class MujocoHand:
    """The hand of our skeleton as MuJoCo moves it: a joint and a position servo a rotation, no gravity."""

    def __init__(self) -> None:
        document = skeleton_document(hand_skeleton(HandDimensions.from_measured({}), "right"))
        root = ElementTree.Element("mujoco")
        ElementTree.SubElement(root, "option", gravity="0 0 0", timestep="0.002")
        bodies = {None: ElementTree.SubElement(root, "worldbody")}
        servos = ElementTree.SubElement(root, "actuator")
        for joint in document["joints"]:
            name = joint["name"]
            place = {"pos": written(np.array(joint["offset"]) / 1e3), "quat": written(joint["orientation"])}
            body = ElementTree.SubElement(bodies[joint["parent"]], "body", {"name": name, **place})
            ElementTree.SubElement(body, "inertial", pos="0 0 0", mass="0.01", diaginertia="1e-5 1e-5 1e-5")
            ElementTree.SubElement(
                body, "joint", name=name, type="hinge", axis=written(joint["axis"]), damping="0.05",
                armature="0.001",
            )  # fmt: skip
            ElementTree.SubElement(servos, "position", name=f"{name}.pos", joint=name, kp="1")
            bodies[name] = body
        self._model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
        self._data = mujoco.MjData(self._model)

    def send_action(self, action: dict[str, float], seconds: float = 0.02) -> None:
        for name, value in action.items():
            self._data.ctrl[self._model.actuator(name).id] = value
        for _ in range(round(seconds / self._model.opt.timestep)):
            mujoco.mj_step(self._model, self._data)

    def degrees(self, joint: str) -> float:
        return math.degrees(self._data.qpos[self._model.joint(joint).qposadr[0]])


def written(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)


@pytest.fixture
def endpoint() -> Iterator[str]:
    endpoint = free_endpoint()
    with open_router([endpoint]):
        yield endpoint


@pytest.fixture
def glove(endpoint: str) -> Iterator[Glove]:
    glove = Glove(endpoint)
    yield glove
    glove.close()


@pytest.fixture
def teleoperator(endpoint: str, glove: Glove) -> Iterator[GlovecalTeleoperator]:
    radians = {f"{name}.pos": JointAction({name: math.pi / 180}, low=-0.3, high=1.8) for name in NAMES}
    config = GlovecalTeleoperatorConfig(
        glove="right", actions=radians, connect=endpoint, hold_s=HOLD_S, ramp_s=0.5, allow_simulated=True
    )
    teleoperator = GlovecalTeleoperator(config)
    teleoperator.connect()
    yield teleoperator
    teleoperator.disconnect()


def follow(teleoperator: GlovecalTeleoperator, hand: MujocoHand, degrees: tuple[float, ...]) -> bool:
    hand.send_action(teleoperator.get_action())
    return bool(np.allclose([hand.degrees(name) for name in NAMES], degrees, atol=0.5))


def test_a_hand_in_mujoco_follows(teleoperator: GlovecalTeleoperator, glove: Glove) -> None:
    hand = MujocoHand()
    assert teleoperator.is_connected
    assert set(teleoperator.action_features) == {f"{name}.pos" for name in NAMES}
    eventually(lambda: follow(teleoperator, hand, DEGREES), "the hand is where the glove is")
    fist = (80.0, 95.0, 90.0)
    glove.pose = replace(POSE, degrees=np.array(fist, np.float32), flags=PoseFlag.SIMULATED)
    eventually(lambda: follow(teleoperator, hand, fist), "it follows")
    glove.pose = replace(POSE, degrees=np.array((170.0, 0, 0), np.float32), flags=PoseFlag.SIMULATED)
    limit = math.degrees(1.8)
    eventually(lambda: follow(teleoperator, hand, (limit, 0, 0)), "the limit holds")


def go_on(teleoperator: GlovecalTeleoperator, hand: MujocoHand) -> None:
    """As LeRobot's loop does, for a minute at most."""
    until = time.monotonic() + 60
    while time.monotonic() < until:
        hand.send_action(teleoperator.get_action())


FAULTY = flagged("I_PIP", RotationFlag.FAULTY_SENSOR).rotation_flags
UNCERTAIN = flagged("I_PIP", RotationFlag.TOO_UNCERTAIN).rotation_flags
FAULTS: dict[str, tuple[Callable[[Pose], Pose | None], str]] = {
    "silent": (lambda pose: None, "its pose is stale"),
    "stale": (lambda pose: replace(pose, flags=pose.flags | PoseFlag.STALE), "its pose is stale"),
    "faulty": (
        lambda pose: replace(pose, rotation_flags=FAULTY),
        "a sensor of rotation I_PIP is faulty",
    ),
    "uncertain": (
        lambda pose: replace(pose, rotation_flags=UNCERTAIN),
        "rotation I_PIP is too uncertain",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_glove_that_fails_stops_the_hand(
    teleoperator: GlovecalTeleoperator, glove: Glove, fault: str
) -> None:
    hand = MujocoHand()
    eventually(lambda: follow(teleoperator, hand, DEGREES), "the hand is where the glove is")
    change, why = FAULTS[fault]
    assert glove.pose is not None
    glove.pose = change(replace(glove.pose, degrees=np.array((0, 0, 0), np.float32)))
    with pytest.raises(GloveNotUsable, match=why):
        go_on(teleoperator, hand)
    assert np.allclose([hand.degrees(name) for name in NAMES], DEGREES, atol=0.5), "it stays where it was"


def test_without_a_pose_it_does_not_connect(endpoint: str) -> None:
    config = GlovecalTeleoperatorConfig(glove="left", actions=dict(ACTIONS), connect=endpoint)
    teleoperator = GlovecalTeleoperator(config)
    with pytest.raises(GloveNotUsable, match="no pose of it came; are glovecal serve"):
        teleoperator.connect()
    assert not teleoperator.is_connected
    with pytest.raises(GloveNotUsable, match="call connect first"):
        teleoperator.get_action()
