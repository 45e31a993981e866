"""Poses for Foxglove: the bones as a tree of frames, the angles as joint states, and what they are worth.

Topics of a glove: ``/glovecal/<glove>/tf`` (``FrameTransforms``, metres), ``/glovecal/<glove>/joint_states``
(``JointStates``, radians, usable angles only) and ``/glovecal/<glove>/state`` (JSON: state, flags, standard
deviations in degrees). Frames are right-handed, those of the hand's skeleton: ``<glove>/hand``,
``<glove>/index_proximal`` and so on, each finger ending in ``<glove>/index_tip``. The hands lie side by side
under the frame ``glovecal`` (x to the fingers, y to the left, z up), palms down: a glove does not know where
its hand is.

While poses are stale or uncalibrated only the state comes. A bone whose angle is not usable keeps still.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar

from glovecal_client.clock import wall_ns
from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HAND, HandBones
from glovecal_models.hand.skeleton import Quaternion as QuaternionWxyz
from glovecal_service.bridges.bone_turns import NO_TURN
from glovecal_service.bridges.bridge import LOOPBACK, Bridge, BridgeOptions
from glovecal_service.bridges.glove_pose import BonesInMotion, GlovePose
from glovecal_service.bridges.traffic import Traffic

if TYPE_CHECKING:
    from foxglove import Channel, Context
    from foxglove.channels import FrameTransformsChannel, JointStatesChannel
    from foxglove.messages import FrameTransforms, JointStates, Timestamp
    from foxglove.websocket import ChannelView, Client, WebSocketServer

DEFAULT_PORT = 8765
ROOT_FRAME = "glovecal"
ASIDE_M = {"right": -0.15, "left": 0.15}
"""Where a hand lies along y, so that two do not lie in each other."""
_MOST_WAITING = 16
"""Messages for a receiver that does not read; then the oldest are dropped."""


class FoxgloveBridge(Bridge):
    """Serves Foxglove's WebSocket protocol (foxglove.sdk.v1)."""

    about = "Foxglove: 3D panel, plots, recording to MCAP"
    to_set_there = (
        "*Open connection*, *Foxglove WebSocket*, the address that is printed; in the 3D panel the frame "
        "`glovecal`"
    )
    units = "m and radians, right-handed, x to the fingers, y to the left, z up"
    when_stale = "frames and joint states stop, the topic state says why"
    options: ClassVar[dict[str, str]] = {
        "port": f"to listen on; default {DEFAULT_PORT}",
        "host": f"address to listen on; default {LOOPBACK}, this computer only",
    }
    needs = ("foxglove", "foxglove-sdk")

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        super().__init__(options, traffic)
        self._host = options.more.get("host", LOOPBACK)
        self._port = DEFAULT_PORT if options.port is None else options.port
        self._server: WebSocketServer | None = None
        self._context: Context | None = None
        self._readers = _Readers()
        self._topics: dict[str, _Topics] = {}

    @property
    def where(self) -> str:
        return f"Foxglove connects to ws://{self._host}:{self._port} (Open connection, Foxglove WebSocket)."

    @property
    def receivers(self) -> int:
        return self._readers.count

    def send(self, hand: GlovePose) -> None:
        if self._context is None:
            return
        topics = self._topics.get(hand.glove)
        if topics is None:
            topics = self._topics[hand.glove] = _Topics(hand.glove, self._context)
        topics.log(hand)
        self._traffic.note_departure(hand)

    def __enter__(self) -> FoxgloveBridge:
        import foxglove

        self._context = foxglove.Context()
        listener: Any = self._readers  # it has of the protocol what is called without capabilities
        try:
            self._server = foxglove.start_server(
                name="Glovecal", host=self._host, port=self._port, server_listener=listener,
                context=self._context, message_backlog_size=_MOST_WAITING,
            )  # fmt: skip
        except (OSError, RuntimeError) as error:
            raise BadInput(
                f"cannot listen on {self._host}:{self._port}, it is in use or not this computer's; choose "
                "another with --port, or --option host=ADDRESS"
            ) from error
        self._port = self._server.port
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._server is not None:
            self._server.stop()
        self._context = None


class _Readers:
    """Foxglove's ``ServerListener``: who has subscribed to what."""

    def __init__(self) -> None:
        self._subscribed: set[tuple[int, int]] = set()
        self._lock = threading.Lock()

    @property
    def count(self) -> int:
        """Clients that read at least one topic."""
        with self._lock:
            return len({client for client, _ in self._subscribed})

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        with self._lock:
            self._subscribed.add((client.id, channel.id))

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        with self._lock:
            self._subscribed.discard((client.id, channel.id))


class _Topics:
    """Those of one glove."""

    def __init__(self, glove: str, context: Context) -> None:
        from foxglove import Channel
        from foxglove.channels import FrameTransformsChannel, JointStatesChannel

        self._glove, self._motion = glove, BonesInMotion()
        self._frames: FrameTransformsChannel = FrameTransformsChannel(
            f"/glovecal/{glove}/tf", context=context
        )
        joints = f"/glovecal/{glove}/joint_states"
        self._joints: JointStatesChannel = JointStatesChannel(joints, context=context)
        self._state: Channel = Channel(f"/glovecal/{glove}/state", message_encoding="json", context=context)

    def log(self, hand: GlovePose) -> None:
        pose = hand.pose
        if hand.state == "live":
            stamp, log_time = _timestamp(pose.wall_ns), pose.wall_ns
            moved = self._motion.turned(hand)
            if moved is not None:
                self._frames.log(transforms(self._glove, *moved, stamp), log_time=log_time)
            self._joints.log(_joint_states(hand, stamp), log_time=log_time)
        else:
            log_time = wall_ns()
        deviations = dict(zip(hand.meaning.rotations, pose.deviations.tolist(), strict=True))
        document = {"state": hand.state, "flags": list(pose.words), "sd_deg": deviations}
        self._state.log(document, log_time=log_time)


def transforms(
    glove: str, bones: HandBones, turned: Sequence[QuaternionWxyz], stamp: Timestamp
) -> FrameTransforms:
    """Every bone, turned in its parent's frame, and each fingertip in that of the last bone."""
    from foxglove.messages import FrameTransform, FrameTransforms, Quaternion, Vector3

    root = [0.0, ASIDE_M[bones.skeleton.hand], 0.0]
    rows = [
        (
            ROOT_FRAME if parent is None else f"{glove}/{bones.names[parent]}",
            f"{glove}/{name}",
            root if parent is None else (head / 1e3).tolist(),
            turn,
        )
        for name, parent, head, turn in zip(bones.names, bones.parents, bones.heads_mm, turned, strict=True)
    ]
    still = NO_TURN
    for bone, name in enumerate(bones.names):
        if name != HAND and bone not in bones.parents:
            finger = name.partition("_")[0]
            rows.append(
                (f"{glove}/{name}", f"{glove}/{finger}_tip", (bones.tails_mm[bone] / 1e3).tolist(), still)
            )
    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=stamp, parent_frame_id=parent, child_frame_id=child,
                translation=Vector3(x=at[0], y=at[1], z=at[2]),
                rotation=Quaternion(w=turn[0], x=turn[1], y=turn[2], z=turn[3]),
            )
            for parent, child, at, turn in rows
        ]
    )  # fmt: skip


def _joint_states(hand: GlovePose, stamp: Timestamp) -> JointStates:
    from foxglove.messages import JointState, JointStates

    joints = [JointState(name=name, position=angle) for name, angle in hand.radians.items()]
    return JointStates(timestamp=stamp, joints=joints)


def _timestamp(time_ns: int) -> Timestamp:
    from foxglove.messages import Timestamp

    seconds, rest_ns = divmod(time_ns, 1_000_000_000)
    return Timestamp(sec=seconds, nsec=rest_ns)
