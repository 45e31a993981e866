"""The Foxglove bridge, read by a client of its own: WebSocket, JSON and the schemas that the server sends."""

from __future__ import annotations

import base64
import json
import math
import struct
from typing import Any

import numpy as np
import pytest
from bridge_support import FIST, FLAT, Stage, WornHand, refused, running_bridge
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from realtime_support import eventually
from scipy.spatial.transform import Rotation
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from glovecal_client.wire.pose import RotationFlag
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_service.bridges.foxglove import ASIDE_M

_HEAD = struct.Struct("<BIQ")


class Reader:
    """Subscribes to every topic and decodes what comes by the schema that came with it."""

    def __init__(self, opened: ClientConnection) -> None:
        self._opened = opened
        self._channels: dict[int, dict[str, Any]] = {}

    def next_of(self, topic: str) -> tuple[int, Any]:
        """Log time and message of the next that comes on ``topic``."""
        while True:
            message = self._opened.recv(timeout=120)
            if isinstance(message, str):
                self._subscribe(json.loads(message))
                continue
            kind, subscription, time_ns = _HEAD.unpack_from(message)
            channel = self._channels.get(subscription)
            if kind == 1 and channel is not None and channel["topic"] == topic:
                return time_ns, _decoded(channel, message[_HEAD.size :])

    def _subscribe(self, said: dict[str, Any]) -> None:
        if said["op"] != "advertise":
            return
        for channel in said["channels"]:
            self._channels[channel["id"]] = channel
            wanted = {"op": "subscribe", "subscriptions": [{"id": channel["id"], "channelId": channel["id"]}]}
            self._opened.send(json.dumps(wanted))


def _decoded(channel: dict[str, Any], payload: bytes) -> Any:
    if channel["encoding"] == "json":
        return json.loads(payload)
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))
    return kind.FromString(payload)


def places_m(message: Any) -> dict[str, np.ndarray]:
    """Where each frame is in the root frame."""
    at: dict[str, tuple[np.ndarray, Rotation]] = {"glovecal": (np.zeros(3), Rotation.identity())}
    for each in message.transforms:
        place, turn = at[each.parent_frame_id]
        offset = [each.translation.x, each.translation.y, each.translation.z]
        local = Rotation.from_quat([each.rotation.x, each.rotation.y, each.rotation.z, each.rotation.w])
        at[each.child_frame_id] = place + turn.apply(offset), turn * local
    return {name: place for name, (place, _) in at.items()}


def require_hand(message: Any, worn: WornHand, angles: dict[str, float]) -> None:
    rows = np.array([[{**FLAT, **angles}[name] for name in HAND_ROTATIONS]])
    tips_mm = forward_kinematics(worn.skeleton, rows).tips_mm[0]
    aside = np.array([0.0, ASIDE_M[worn.hand], 0.0])
    places = places_m(message)
    for finger, tip_mm in zip(FINGERS.values(), tips_mm, strict=True):
        np.testing.assert_allclose(1e3 * (places[f"{worn.glove}/{finger}_tip"] - aside), tip_mm, atol=1e-3)


def test_frames_joints_and_state_of_both_hands(stage: Stage) -> None:
    unsure = {"R_PIP": int(RotationFlag.TOO_UNCERTAIN)}
    spread = {"IM_ABD": 20.0, "MR_ABD": 10.0, "W_FLEX": 15.0}
    stage.show(right={"angles": FIST}, left={"angles": spread})
    with running_bridge(stage, "foxglove", "--port", 0) as bridge:
        eventually(lambda: bridge.counts("left").get("sent"), "the topics are there")
        host, port = bridge.place()
        with connect(f"ws://{host}:{port}", subprotocols=[Subprotocol("foxglove.sdk.v1")]) as opened:
            reader = Reader(opened)
            _, frames = reader.next_of("/glovecal/left/tf")
            require_hand(frames, stage.left, spread)
            time_ns, frames = reader.next_of("/glovecal/right/tf")
            require_hand(frames, stage.right, FIST)
            stamp = frames.transforms[0].timestamp
            assert stamp.seconds * 1_000_000_000 + stamp.nanos == time_ns
            stage.show(right={"angles": {**FIST, "R_PIP": 0.0}, "rotation_flags": unsure})

            def joints() -> dict[str, float]:
                _, message = reader.next_of("/glovecal/right/joint_states")
                return {joint.name: joint.position for joint in message.joints}

            sure = eventually(
                lambda: found if "R_PIP" not in (found := joints()) else None, "R_PIP is unsure"
            )
            expected = {
                name: math.radians(angle) for name, angle in {**FLAT, **FIST}.items() if name != "R_PIP"
            }
            assert sure == pytest.approx(expected, abs=1e-7)
            _, frames = reader.next_of("/glovecal/right/tf")
            require_hand(frames, stage.right, FIST)
            _, state = reader.next_of("/glovecal/right/state")
            assert (state["state"], state["sd_deg"]["I_PIP"]) == ("live", 1.0)
            assert eventually(lambda: bridge.lines[-1]["receivers"], "a reader is counted") == 1
            stage.show(right=None)

            def state_now() -> str:
                return reader.next_of("/glovecal/right/state")[1]["state"]

            eventually(lambda: state_now() == "stale", "the state says so")
            assert bridge.counts("left")["left_out"] == 0


def test_a_port_in_use_is_told(stage: Stage) -> None:
    with running_bridge(stage, "foxglove", "--port", 0) as bridge:
        _, port = bridge.place()
        said = refused(stage, "foxglove", "--port", port)
    assert f"cannot listen on 127.0.0.1:{port}, it is in use or not this computer's" in said
