"""Poses as ROS 2's ``sensor_msgs/JointState``, in the form of ``rmw_zenoh`` and without any ROS here.

One topic a glove, ``/glovecal/<glove>/joint_states``: names are those of the rotations, positions radians,
the stamp is the hand's time by the capture computer's wall clock. A topic on zenoh, as rmw_zenoh has it: the
key holds domain, topic, type and the type's hash, the payload is CDR, an attachment holds number, time and
publisher, and liveliness tokens make ``ros2 topic list`` know it. Releases before Jazzy have other forms.

A joint whose angle is too uncertain, or held because its sensor fails, is left out of the message; while
poses are stale or uncalibrated nothing is sent. With a robot's hand as an option the joints are the robot's;
then nothing is sent either while a rotation that moves it is not usable.
"""

from __future__ import annotations

import hashlib
import logging
import struct
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType
from typing import Any, ClassVar

import zenoh

from glovecal_client.clock import wall_ns
from glovecal_client.errors import NoAnswer
from glovecal_client.session import open_client
from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.robot_description import RobotDescription
from glovecal_models.hand.retargeting.robot_follower import RobotFollower
from glovecal_models.hand.skeleton import Skeleton
from glovecal_service.bridges.bridge import Bridge, BridgeOptions
from glovecal_service.bridges.glove_pose import GlovePose
from glovecal_service.bridges.traffic import Traffic

_log = logging.getLogger(__name__)
TYPE = "sensor_msgs::msg::dds_::JointState_"
TYPE_HASH = "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
NODE = "glovecal"
DEFAULT_ROUTER = "127.0.0.1:7447"
LAST_DOMAIN = 232
_RELIABLE_KEEP_LAST_10 = "::,10:,:,:,,"
_NOTHING = "%"
"""An empty part of a token: no enclave, no namespace."""
_ATTACHMENT = struct.Struct("<qqB16s")
_CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_WAIT_S = 5.0


class Ros2Bridge(Bridge):
    """Publishes to the nodes of a ROS 2 whose middleware is rmw_zenoh."""

    about = "ROS 2 (Jazzy and later) with rmw_zenoh: sensor_msgs/JointState"
    to_set_there = "`RMW_IMPLEMENTATION=rmw_zenoh_cpp`; topics `/glovecal/GLOVE/joint_states`"
    units = "radians, stamps of the capture computer's wall clock"
    when_stale = "nothing is sent"
    options: ClassVar[dict[str, str]] = {
        "to": f"HOST:PORT of the ROS 2 router (rmw_zenohd); default {DEFAULT_ROUTER}",
        "domain": f"ROS_DOMAIN_ID, 0 (default) to {LAST_DOMAIN}",
        "robot": "joints of a robot's hand in place of the person's: shadow, allegro, leap or a URDF file",
    }

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        super().__init__(options, traffic)
        self._host, self._port = options.address(DEFAULT_ROUTER)
        self._domain = options.number("domain", 0, 0, LAST_DOMAIN)
        self._opened = ExitStack()
        self._session: zenoh.Session | None = None
        self._robot = None if "robot" not in options.more else RobotDescription.named(options.more["robot"])
        self._followers: dict[str, tuple[Skeleton, RobotFollower | None]] = {}
        self._topics: dict[str, _Topic] = {}
        self._node: zenoh.LivelinessToken | None = None

    @property
    def where(self) -> str:
        return f"ROS 2 topics {topic_of('GLOVE')}, by the router at {self._host}:{self._port}."

    @property
    def receivers(self) -> int:
        """Topics that somebody listens to."""
        return sum(topic.is_listened_to for topic in list(self._topics.values()))

    def send(self, hand: GlovePose) -> None:
        radians = hand.radians if self._robot is None else self._robots(hand, self._robot)
        if hand.state != "live" or self._session is None or radians is None:
            return
        topic = self._topics.get(hand.glove)
        if topic is None:
            number = len(self._topics) + 1
            topic = self._topics[hand.glove] = _Topic.declared(
                self._session, self._domain, hand.glove, number
            )
        topic.put(joint_state(hand.pose.wall_ns, ros_name(hand.glove), radians))
        self._traffic.note_departure(hand)

    def _robots(self, hand: GlovePose, robot: RobotDescription) -> dict[str, float] | None:
        """Of the robot's joints; None where they must not move."""
        skeleton, pose = hand.meaning.skeleton, hand.pose
        if skeleton is None or hand.state != "live":
            self._followers.pop(hand.glove, None)  # it begins anew from where it then is
            return None
        if hand.glove not in self._followers or self._followers[hand.glove][0] is not skeleton:
            try:
                follower = RobotFollower(skeleton, robot.hand(skeleton.hand, {}))
            except BadInput as error:
                _log.warning("glove %s moves no robot: %s", hand.glove, error)
                follower = None
            self._followers[hand.glove] = skeleton, follower
        follower = self._followers[hand.glove][1]
        if follower is None:
            return None
        return follower.radians(hand.meaning.rotations, pose.degrees, pose.usable)

    def __enter__(self) -> Ros2Bridge:
        endpoint = f"tcp/{self._host}:{self._port}"
        try:
            self._session = self._opened.enter_context(open_client([endpoint], wait_s=_WAIT_S, foreign=True))
        except NoAnswer as error:
            raise BadInput(
                f"no ROS 2 router at {self._host}:{self._port}; start it (ros2 run rmw_zenoh_cpp "
                "rmw_zenohd), or say where it is: --to HOST:PORT"
            ) from error
        zid = str(self._session.info.zid())
        node = f"@ros2_lv/{self._domain}/{zid}/0/0/NN/{_NOTHING}/{_NOTHING}/{NODE}"
        self._node = self._session.liveliness().declare_token(node)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._topics.clear()
        self._session = self._node = None
        self._opened.close()


@dataclass
class _Topic:
    """One glove's publisher, known to ROS as long as its token is kept."""

    publisher: zenoh.Publisher
    token: zenoh.LivelinessToken
    gid: bytes
    sequence: int = 0

    @classmethod
    def declared(cls, session: zenoh.Session, domain: int, glove: str, number: int) -> _Topic:
        """``number``: of the publisher in this session."""
        name = topic_of(glove)
        publisher = session.declare_publisher(f"{domain}{name}/{TYPE}/{TYPE_HASH}", express=True)
        mangled = name.replace("/", "%")
        token = (
            f"@ros2_lv/{domain}/{session.info.zid()}/0/{number}/MP/{_NOTHING}/{_NOTHING}/{NODE}/{mangled}/"
            f"{TYPE}/{TYPE_HASH}/{_RELIABLE_KEEP_LAST_10}"
        )
        gid = hashlib.blake2b(token.encode(), digest_size=16).digest()
        return cls(publisher, session.liveliness().declare_token(token), gid)

    @property
    def is_listened_to(self) -> bool:
        status: Any = self.publisher.matching_status  # no bool, whatever its stub says
        return status.matching

    def put(self, message: bytes) -> None:
        self.sequence += 1
        attachment = _ATTACHMENT.pack(self.sequence, wall_ns(), len(self.gid), self.gid)
        self.publisher.put(message, attachment=attachment)


def ros_name(glove: str) -> str:
    """Letters, digits and underscores, not beginning with a digit."""
    name = glove.replace("-", "_")
    return f"glove_{name}" if name[:1].isdigit() else name


def topic_of(glove: str) -> str:
    return f"/glovecal/{ros_name(glove)}/joint_states"


def joint_state(stamp_ns: int, frame: str, radians: Mapping[str, float]) -> bytes:
    """A message in CDR, little-endian, without velocities and efforts: they are not measured."""
    body = bytearray(struct.pack("<iI", *divmod(stamp_ns, 1_000_000_000)))
    _add_text(body, frame)
    _add(body, "I", len(radians))
    for name in radians:
        _add_text(body, name)
    _add(body, "I", len(radians))
    for angle in radians.values():
        _add(body, "d", angle)
    _add(body, "I", 0)
    _add(body, "I", 0)
    return _CDR_LITTLE_ENDIAN + body


def _add(body: bytearray, form: str, value: float) -> None:
    """Aligned to its own size, counted after the four bytes that say how the message is encoded."""
    body += bytes(-len(body) % struct.calcsize(form)) + struct.pack(f"<{form}", value)


def _add_text(body: bytearray, text: str) -> None:
    encoded = text.encode() + b"\x00"
    _add(body, "I", len(encoded))
    body += encoded
