"""Poses of a simulated glove on zenoh, as the service publishes them."""

from __future__ import annotations

import json
import threading
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from glovecal_client import GloveKeys, Pose, PoseFlag, encode_pose, open_client

NAMES = ("I_MCP", "I_PIP", "M_PIP")
MODEL = "ab" * 32
DEGREES = (30.0, 45.0, 60.0)
HOLD_S = 2.0
"""``hold_s`` where a test follows a glove: a busy computer may be silent for a second."""
POSE = Pose(
    1, 7, 0, 0, np.array(DEGREES, np.float32), np.ones(3, np.float32), np.zeros(3, np.uint8), MODEL
)  # fmt: skip


class Glove:
    """Publishes poses 100 times a second, as the service does, until told otherwise."""

    def __init__(self, endpoint: str, pose: Pose = POSE, names: tuple[str, ...] = NAMES) -> None:
        self.pose: Pose | None = replace(pose, flags=PoseFlag.SIMULATED)
        self._keys, self._stop, self._open = GloveKeys("lab", "right"), threading.Event(), ExitStack()
        self._session = self._open.enter_context(open_client([endpoint], wait_s=60))
        self._meta = json.dumps({"model": MODEL, "rotations": names}).encode()
        self._session.put(self._keys.pose_meta, self._meta)
        self._open.callback(
            self._session.declare_queryable(
                self._keys.pose_meta, lambda query: query.reply(self._keys.pose_meta, self._meta)
            ).undeclare
        )
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def _publish(self) -> None:
        number = 0
        while not self._stop.wait(0.01):
            number += 1
            if self.pose is not None:
                message = encode_pose(replace(self.pose, sequence=number, monotonic_ns=number * 10_000_000))
                self._session.put(self._keys.pose, message)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._open.close()
