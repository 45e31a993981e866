"""What gloves send now, for open pages: one zenoh session, and a subscription for each glove that is watched.

A page gets the newest pose at most 30 times a second, never a queue: who is slow misses poses.
"""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack, suppress
from typing import Any

import numpy as np
import zenoh

from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.keys import GloveKeys, all_gloves, parse_glove_key
from glovecal_client.pose_subscriber import PoseSubscriber
from glovecal_client.queries import ask, ask_json, json_object
from glovecal_client.session import open_client
from glovecal_client.wire.frame import decode_frame
from glovecal_client.wire.pose import Pose
from glovecal_service.settings import Settings
from glovecal_service.studio.glove_state import GloveState, glove_state

LOST_AFTER_S = 3.0
"""Capture says once a second what it does; silence for so long means that it is gone."""
ROUTER_WITHIN_S = 2.0


class GloveFeed:
    """The newest of one glove. Closed by the ``LiveFeeds`` that made it."""

    def __init__(self, session: zenoh.Session, site: str, glove: str) -> None:
        keys = GloveKeys(site, glove)
        self.glove = glove
        self._poses = PoseSubscriber(session, site, glove)
        self._raw: bytes | None = None
        self._meta: dict[str, Any] = {}
        hear = zenoh.handlers.Callback
        self._subscribers = [
            session.declare_subscriber(keys.raw, hear(self._hear_raw, indirect=False)),
            session.declare_subscriber(keys.meta, hear(self._hear_meta, indirect=False)),
        ]
        with suppress(NoAnswer):
            self._meta = ask_json(session, keys.meta, timeout_s=1.0)

    @property
    def pose(self) -> Pose | None:
        """The newest pose, None before the first."""
        return self._poses.latest

    @property
    def is_stale(self) -> bool:
        return self._poses.stale

    @property
    def sensors(self) -> list[str]:
        return list(self._meta.get("sensors", []))

    def names(self) -> dict[str, Any]:
        """What the numbers of ``array`` are: rotations and sensors, in their order."""
        pose = self.pose
        rotations: tuple[str, ...] = ()
        if pose is not None and not pose.uncalibrated:
            with suppress(NoAnswer):
                rotations = self._poses.rotations(pose)
        return {"rotations": list(rotations), "sensors": self.sensors}

    def array(self, pose: Pose) -> bytes:
        """Float32: R, S, R angles and R standard deviations (degrees), S readings (counts)."""
        raw = self._readings()
        head = np.array([len(pose.degrees), len(raw)])
        return np.concatenate((head, pose.degrees, pose.deviations, raw)).astype("<f4").tobytes()

    def close(self) -> None:
        self._poses.close()
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def _readings(self) -> np.ndarray:
        message = self._raw
        if message is not None:
            with suppress(WireError):
                return decode_frame(message).readings
        return np.empty(0)

    def _hear_raw(self, sample: zenoh.Sample) -> None:
        self._raw = sample.payload.to_bytes()

    def _hear_meta(self, sample: zenoh.Sample) -> None:
        self._meta = json_object(sample.payload.to_bytes()) or self._meta


class LiveFeeds:
    """Feeds of all gloves that pages watch, and what capture daemons say of theirs."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._kept = ExitStack()
        self._session: zenoh.Session | None = None
        self._feeds: dict[str, tuple[GloveFeed, int]] = {}
        self._statuses: dict[str, tuple[float, dict[str, Any]]] = {}

    def open(self, glove: str) -> GloveFeed:
        """The feed of ``glove``; ``release`` it. Waits for the router. Raises NoAnswer, BadName."""
        with self._lock:
            feed, users = self._feeds.get(glove, (None, 0))
            if feed is None:
                feed = GloveFeed(self._connected(), self._settings.site, glove)
            self._feeds[glove] = feed, users + 1
            return feed

    def release(self, feed: GloveFeed) -> None:
        """The last one that lets a glove go ends its subscriptions."""
        with self._lock:
            _, users = self._feeds[feed.glove]
            if users > 1:
                self._feeds[feed.glove] = feed, users - 1
                return
            del self._feeds[feed.glove]
        feed.close()

    def states(self) -> dict[str, GloveState]:
        """Each glove that a capture daemon was heard of, by name. Raises NoAnswer without a router."""
        with self._lock:
            self._connected()
        now, states = time.monotonic(), {}
        for glove, (heard, status) in sorted(self._statuses.copy().items()):
            feed = self._feeds.get(glove, (None, 0))[0]
            states[glove] = glove_state(
                status, now - heard > LOST_AFTER_S, None if feed is None else feed.pose,
                feed is not None and feed.is_stale,
            )  # fmt: skip
        return states

    def close(self) -> None:
        with self._lock:
            for feed, _ in self._feeds.values():
                feed.close()
            self._feeds.clear()
            self._kept.close()
            self._session = None

    def _connected(self) -> zenoh.Session:
        """The session, opened with the first page that needs it."""
        if self._session is None:
            self._session = self._kept.enter_context(
                open_client((self._settings.zenoh,), wait_s=ROUTER_WITHIN_S)
            )
            key = all_gloves(self._settings.site, "status")
            hear = zenoh.handlers.Callback(self._hear_status, indirect=False)
            self._kept.callback(self._session.declare_subscriber(key, hear).undeclare)
            with suppress(NoAnswer):
                for sample in ask(self._session, key, timeout_s=1.0):
                    self._hear_status(sample)
        return self._session

    def _hear_status(self, sample: zenoh.Sample) -> None:
        status = json_object(sample.payload.to_bytes())
        if status is not None:
            self._statuses[parse_glove_key(str(sample.key_expr))[0].glove] = time.monotonic(), status
