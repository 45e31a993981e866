"""A ROS 2 node by an implementation of rmw_zenoh's protocol that nobody here wrote: prints what it gets.

Arguments: port of the router, topic, type hash. First the topics it knows, then a line of JSON a message.
"""

from __future__ import annotations

import json
import sys
import time

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Subscriber
from zenoh_ros2_sdk.discovery import get_topic_names_and_types
from zenoh_ros2_sdk.session import ZenohSession

TYPE = "sensor_msgs/msg/JointState"


def main(port: int, topic: str, type_hash: str) -> None:
    session = ZenohSession.get_instance("127.0.0.1", port)
    session.store = get_typestore(Stores.ROS2_JAZZY)  # else it asks the internet for the type
    session._registered_types[TYPE] = TYPE  # type: ignore[assignment]
    print(json.dumps({"topics": dict(get_topic_names_and_types(0, "127.0.0.1", port))}), flush=True)
    ROS2Subscriber(topic, TYPE, _print, msg_definition="", domain_id=0, router_port=port, type_hash=type_hash)
    while True:
        time.sleep(60)


def _print(message: object) -> None:
    header = message.header  # type: ignore[attr-defined]
    document = {
        "stamp_ns": header.stamp.sec * 1_000_000_000 + header.stamp.nanosec,
        "frame": header.frame_id,
        "position": dict(zip(message.name, message.position.tolist(), strict=True)),  # type: ignore[attr-defined]
        "others": [*message.velocity.tolist(), *message.effort.tolist()],  # type: ignore[attr-defined]
    }
    print(json.dumps(document), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], sys.argv[3])
