"""The ROS 2 bridge, heard by an independent implementation of rmw_zenoh's protocol; its bytes by rosbags'."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import zenoh
from bridge_support import FIST, FLAT, Stage, refused, running_bridge
from realtime_support import eventually, free_endpoint
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk.attachment import Attachment

from glovecal_client.session import open_client, open_router
from glovecal_client.wire.pose import RotationFlag
from glovecal_models.hand.retargeting.robot import RobotHand
from glovecal_service.bridges.ros2 import TYPE_HASH, joint_state, ros_name, topic_of

RECEIVER = Path(__file__).with_name("ros2_receiver.py")
ROS = get_typestore(Stores.ROS2_JAZZY)
JOINT_STATE = "sensor_msgs/msg/JointState"


def test_the_bytes_and_the_hash_are_those_of_rosbags() -> None:
    assert ROS.hash_rihs01(JOINT_STATE) == TYPE_HASH
    header, stamp = ROS.types["std_msgs/msg/Header"], ROS.types["builtin_interfaces/msg/Time"]
    for names in ([], ["I_PIP"], ["I", "I_MCP", "T_TMC", "RP_ABD"]):
        radians = {name: 0.1 * number - 0.2 for number, name in enumerate(names)}
        message = ROS.types[JOINT_STATE](
            header(stamp(1_795_000_000, 123_456_789), "left_hand"), names, np.array(list(radians.values())),
            np.array([]), np.array([]),
        )  # fmt: skip
        ours = joint_state(1_795_000_000_123_456_789, "left_hand", radians)
        assert ours == bytes(ROS.serialize_cdr(message, JOINT_STATE))


def test_gloves_have_names_that_ros_allows() -> None:
    assert [ros_name(name) for name in ("right", "left-hand", "2nd")] == ["right", "left_hand", "glove_2nd"]
    assert topic_of("left-hand") == "/glovecal/left_hand/joint_states"


@contextmanager
def receiving(port: int, topic: str) -> Iterator[list[dict[str, Any]]]:
    """What the independent node prints, as it comes."""
    client = {**os.environ, "ZENOH_CONFIG_OVERRIDE": 'mode="client"'}
    command = [sys.executable, str(RECEIVER), str(port), topic, TYPE_HASH]
    process = subprocess.Popen(command, env=client, stdout=subprocess.PIPE, text=True)
    lines: list[dict[str, Any]] = []

    def read() -> None:
        assert process.stdout is not None
        lines.extend(json.loads(line) for line in process.stdout)

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    try:
        yield lines
    finally:
        process.kill()
        process.wait()
        reader.join()
        assert process.stdout is not None
        process.stdout.close()


def test_a_node_lists_the_topics_and_gets_both_hands_in_radians(stage: Stage) -> None:
    unsure = {"R_PIP": int(RotationFlag.TOO_UNCERTAIN), "I_DIP": int(RotationFlag.EXTRAPOLATING)}
    stage.show(right={"angles": FIST, "rotation_flags": unsure}, left={"angles": {"I_PIP": 90.0}})
    router = free_endpoint()
    port = int(router.rpartition(":")[2])
    with open_router([router]), running_bridge(stage, "ros2", "--to", f"127.0.0.1:{port}") as bridge:
        eventually(lambda: bridge.counts("left").get("sent"), "the topics are there")
        with receiving(port, topic_of("right")) as right, receiving(port, topic_of("left")) as left:
            topics = eventually(lambda: right and right[0]["topics"], "the node's list of topics")
            assert topics == {topic_of(hand.glove): [JOINT_STATE] for hand in stage.hands}
            of_left = eventually(lambda: left[1:2], "the left hand")[0]
            of_right = eventually(lambda: right[1:2], "the right hand")[0]
            expected = {name: math.radians(angle) for name, angle in {**FLAT, "I_PIP": 90.0}.items()}
            assert of_left["position"] == expected
            assert (of_left["frame"], of_left["others"]) == ("left", [])
            wanted = {name: angle for name, angle in {**FLAT, **FIST}.items() if name != "R_PIP"}
            assert of_right["position"] == {name: math.radians(angle) for name, angle in wanted.items()}
            assert eventually(lambda: bridge.lines[-1]["receivers"] == 2, "both are listened to")
            stage.show(right=None)
            eventually(lambda: bridge.counts("right")["state"] == "stale", "silence")
            count = len(right)
            eventually(lambda: left[-1]["stamp_ns"] > right[-1]["stamp_ns"] + 10**9, "a second of the left")
            assert len(right) == count, "nothing stale is sent"


def test_a_robots_joints_are_sent_while_every_rotation_that_moves_it_is_usable(stage: Stage) -> None:
    stage.show(right={"angles": FIST}, left={"angles": FIST})
    router = free_endpoint()
    port = int(router.rpartition(":")[2])
    options = ("--to", f"127.0.0.1:{port}", "--option", "robot=leap")
    limits = dict(zip(RobotHand.known("leap_right").free, RobotHand.known("leap_right").limits, strict=True))
    with open_router([router]), running_bridge(stage, "ros2", *options) as bridge:

        def stands_still() -> bool:
            """Between two lines that the bridge told of itself."""
            of_right = [line.get("gloves", {}).get("right") for line in bridge.lines[-2:]]
            if len(of_right) < 2 or None in of_right:
                return False
            before, now = of_right
            return before["received"] < now["received"] and before["sent"] == now["sent"]

        eventually(lambda: bridge.counts("right").get("sent"), "the topic is there")
        with receiving(port, topic_of("right")) as right:
            sent = eventually(lambda: right[1:2], "the right hand")[0]["position"]
            assert set(sent) == set(limits)
            for name, (low, high) in limits.items():
                assert low - 1e-9 <= sent[name] <= high + 1e-9
            assert sent["if_pip"] > 1.2
            eventually(
                lambda: "left moves no robot" in bridge.complaints, "of LEAP there is a right hand only"
            )
            assert not bridge.counts("left").get("sent")
            stage.show(right={"angles": FIST, "rotation_flags": {"M_PIP": int(RotationFlag.TOO_UNCERTAIN)}})
            eventually(stands_still, "nothing moves the robot")
            count = len(right)
            stage.show(right={"angles": FIST})
            eventually(lambda: len(right) > count + 10, "it follows again")
    said = refused(stage, "ros2", "--option", "robot=lepa")
    assert "did you mean 'leap'" in said


def test_a_message_carries_number_time_and_publisher(stage: Stage) -> None:
    stage.show(right={})
    got: list[tuple[str, bytes]] = []

    def hear(sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        got.append((str(sample.key_expr), sample.attachment.to_bytes()))

    options = ("--to", stage.endpoint.removeprefix("tcp/"), "--option", "domain=7", "--glove", "right")
    with open_client([stage.endpoint]) as session, running_bridge(stage, "ros2", *options):
        session.declare_subscriber("7/**", zenoh.handlers.Callback(hear, indirect=False))
        eventually(lambda: len(got) > 2, "messages")
    key, _ = got[0]
    assert key == f"7/glovecal/right/joint_states/sensor_msgs::msg::dds_::JointState_/{TYPE_HASH}"
    parts = [Attachment.from_bytes(attachment) for _, attachment in got[:3]]
    assert [part.sequence_id - parts[0].sequence_id for part in parts] == [0, 1, 2]
    assert len({part.gid for part in parts}) == 1
    assert {len(attachment) for _, attachment in got} == {33}


def test_without_a_router_it_says_how_to_start_one(stage: Stage) -> None:
    nobody = free_endpoint().removeprefix("tcp/")
    said = refused(stage, "ros2", "--to", nobody)
    assert f"no ROS 2 router at {nobody}; start it (ros2 run rmw_zenoh_cpp rmw_zenohd)" in said
    said = refused(stage, "ros2", "--option", "domain=233")
    assert "option domain is '233'; give a whole number from 0 to 232" in said
