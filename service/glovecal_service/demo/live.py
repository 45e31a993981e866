"""Listening to the live poses: how old they are when they arrive, and whether any is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import zenoh

from glovecal_client.clock import clock_ns
from glovecal_client.errors import WireError
from glovecal_client.keys import GloveKeys
from glovecal_client.pose_order import PoseCounts, PoseOrder
from glovecal_client.session import open_client
from glovecal_client.wire.pose import Pose, decode_pose


class PoseMeter:
    """Takes every pose of a glove and notes when it came.

    Frame times are CLOCK_MONOTONIC of the capture daemon, so latency is true on one computer only.
    """

    def __init__(self) -> None:
        self._order = PoseOrder()
        self._latency_ns: list[int] = []
        self._calibrated = 0
        self._run_id = 0
        self._skipped = 0
        self.poses: list[Pose] = []
        """All that came, each frame's once."""

    def hear(self, sample: zenoh.Sample) -> None:
        now = clock_ns()
        try:
            pose: Pose = decode_pose(sample.payload.to_bytes())
        except WireError:
            self._order.note_damage()
            return
        if self._order.accept(pose) and not pose.stale:
            self._count_skipped(pose)
            self._latency_ns.append(now - pose.monotonic_ns)
            self.poses.append(pose)
            self._calibrated += not pose.uncalibrated

    @property
    def counts(self) -> PoseCounts:
        return self._order.counts()

    def _count_skipped(self, pose: Pose) -> None:
        """The service counts from the start of a run; the first frames may have been skipped already."""
        if pose.run_id != self._run_id:
            self._run_id, self._skipped = pose.run_id, 0
        self._skipped = max(self._skipped, pose.skipped)

    @property
    def skipped(self) -> int:
        """Frames of the newest run that the service left out to stay current."""
        return self._skipped

    @property
    def calibrated(self) -> int:
        """Poses that came from a calibration model."""
        return self._calibrated

    def latency_ms(self, percent: float) -> float:
        """A percentile of reading-to-pose latency, milliseconds; NaN before the first pose."""
        return float(np.percentile(self._latency_ns, percent)) / 1e6 if self._latency_ns else float("nan")


@contextmanager
def metered_poses(endpoint: str, site: str, glove: str) -> Iterator[PoseMeter]:
    """A meter that listens until the end of the block."""
    meter = PoseMeter()
    with open_client([endpoint], wait_s=10) as session:
        handler = zenoh.handlers.Callback(meter.hear, indirect=False)
        subscriber = session.declare_subscriber(GloveKeys(site, glove).pose, handler)
        try:
            yield meter
        finally:
            subscriber.undeclare()
