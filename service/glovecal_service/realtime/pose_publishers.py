"""One zenoh publisher for each glove's poses."""

from __future__ import annotations

import zenoh

from glovecal_client.keys import GloveKeys
from glovecal_client.wire.pose import POSE_ENCODING


class PosePublishers:
    """Declared when a glove's first pose goes out. For one publishing thread.

    Not express: poses of one turn then leave in few packets, at half the cost (13 in place of 25 to 36 us).
    """

    def __init__(self, session: zenoh.Session, site: str) -> None:
        self._session = session
        self._site = site
        self._publishers: dict[str, zenoh.Publisher] = {}

    def publish(self, glove: str, pose: bytes) -> None:
        """Send an encoded pose; drops it rather than wait for a slow subscriber."""
        publisher = self._publishers.get(glove)
        if publisher is None:
            publisher = self._publishers[glove] = self._session.declare_publisher(
                GloveKeys(self._site, glove).pose,
                encoding=POSE_ENCODING,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.INTERACTIVE_HIGH,
            )
        publisher.put(pose)
