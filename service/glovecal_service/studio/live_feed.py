"""What gloves send now, for open pages: one zenoh session, and a subscription for each glove that is watched.

A page gets the newest pose at most 30 times a second, never a queue: who is slow misses poses.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any

import numpy as np
import zenoh

from glovecal_client.errors import BadName, NoAnswer, QueryRefused, WireError
from glovecal_client.keys import GloveKeys, all_gloves, all_services, check_channel_name, parse_glove_key
from glovecal_client.pose_subscriber import PoseSubscriber
from glovecal_client.publishers import Publishers
from glovecal_client.run_metas import RUNS_KEPT, RunMetas
from glovecal_client.session import ask_json, json_object, open_client
from glovecal_client.wire.frame import decode_frame
from glovecal_client.wire.pose import Pose
from glovecal_service.settings import Settings
from glovecal_service.studio.glove_state import GloveState, glove_state

LOST_AFTER_S = 3.0
"""Capture says once a second what it does; silence for so long means that it is gone."""
ROUTER_WITHIN_S = 2.0
ANSWER_WITHIN_S = 1.0
FIRST_LOOK_S = 0.3
MOST_GLOVES = 256


class GloveFeed:
    """The newest of one glove. Closed by the ``LiveFeeds`` that made it."""

    def __init__(self, session: zenoh.Session, site: str, glove: str) -> None:
        keys = GloveKeys(site, glove)
        self.glove = glove
        self._poses = PoseSubscriber(session, site, glove)
        self._raw: bytes | None = None
        self._metas = RunMetas()
        hear = zenoh.handlers.Callback
        self._subscribers = [
            session.declare_subscriber(keys.raw, hear(self._hear_raw, indirect=False)),
            session.declare_subscriber(keys.meta, hear(self._hear_meta, indirect=False)),
        ]
        # Nobody waits for the answer: a capture daemon may be gone.
        session.get(keys.meta, hear(self._hear_meta_reply, indirect=False), timeout=ANSWER_WITHIN_S)

    @property
    def pose(self) -> Pose | None:
        """The newest pose, None before the first."""
        return self._poses.latest

    @property
    def is_stale(self) -> bool:
        return self._poses.stale

    @property
    def sensors(self) -> list[str]:
        names = self._meta().get("sensors")
        return [str(name) for name in names] if isinstance(names, list) else []

    def names(self, pose: Pose) -> dict[str, Any]:
        """What the numbers of ``array`` are: rotations and sensors, in their order, and by which model."""
        rotations: tuple[str, ...] = ()
        if not pose.uncalibrated:
            with suppress(NoAnswer):
                rotations = self._poses.rotations(pose)
        return {"rotations": list(rotations), "sensors": self.sensors, "model": pose.model_sha256}

    def array(self, pose: Pose) -> bytes:
        """Float32: R, S, R angles and R standard deviations (degrees), S readings (counts)."""
        raw = self.readings()
        head = np.array([len(pose.degrees), len(raw)])
        return np.concatenate((head, pose.degrees, pose.deviations, raw)).astype("<f4").tobytes()

    def close(self) -> None:
        self._poses.close()
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def readings(self) -> np.ndarray:
        """The newest, in counts, shape (S,); empty before the first."""
        message = self._raw
        if message is not None:
            with suppress(WireError):
                return decode_frame(message).readings
        return np.empty(0)

    def _hear_raw(self, sample: zenoh.Sample) -> None:
        self._raw = sample.payload.to_bytes()

    def _hear_meta_reply(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            self._hear_meta(reply.ok)

    def _hear_meta(self, sample: zenoh.Sample) -> None:
        if meta := json_object(sample.payload.to_bytes()):
            self._metas.note(meta, keep=self._run)

    def _meta(self) -> dict[str, Any]:
        """Of the run whose poses come, or of the only one that was heard of."""
        return self._metas.of(self._run) or self._metas.newest or {}

    @property
    def _run(self) -> str:
        pose = self._poses.latest
        return "" if pose is None else f"{pose.run_id:016x}"


class LiveFeeds:
    """Feeds of all gloves that pages watch, and what capture daemons and the service say of them.

    Only one thing is waited for: the router, by those who ask while there is none.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        """Of the feeds; nobody waits for an answer while holding it."""
        self._connecting = threading.Lock()
        self._kept = ExitStack()
        self._session: zenoh.Session | None = None
        self._feeds: dict[str, tuple[GloveFeed, int]] = {}
        self._heard: dict[str, dict[str, tuple[float, dict[str, Any]]]] = {}
        """The newest status of each run by glove, with the time: whoever said it."""
        self._statuses: dict[str, tuple[float, dict[str, Any]]] = {}
        """Of these, those to believe."""
        self._publishers: Publishers | None = None
        self._accounts: dict[str, tuple[float, Any]] = {}
        """What the process that has a glove said of it last, and when."""

    def open(self, glove: str) -> GloveFeed:
        """The feed of ``glove``; ``release`` it. Waits for the router. Raises NoAnswer, BadName."""
        session = self._connected()
        with self._lock:
            feed, users = self._feeds.get(glove, (None, 0))
            if feed is None:
                feed = GloveFeed(session, self._settings.site, glove)
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
        """Each glove that a capture daemon was heard of, by name. Raises NoAnswer without a router.

        A status counts while the glove has its liveliness token, and of several runs that whose frames come.
        """
        self._connected()
        self._believe()
        now, states = time.monotonic(), {}
        for glove, (heard, status) in sorted(self._statuses.copy().items()):
            feed = self._feeds.get(glove, (None, 0))[0]
            said, account = self._accounts.get(glove, (-LOST_AFTER_S, None))
            account = account if now - said < LOST_AFTER_S else None
            states[glove] = glove_state(
                status, now - heard > LOST_AFTER_S, None if feed is None else feed.pose,
                feed is not None and feed.is_stale, account if isinstance(account, dict) else None,
            )  # fmt: skip
        return states

    def _believe(self) -> None:
        for glove, runs in self._heard.copy().items():
            if self._publishers is not None and self._publishers.has(glove):
                newest = max(runs.copy().values(), key=lambda each: each[0])
                self._statuses[glove] = runs.get(self._run_of(glove), newest)

    def _run_of(self, glove: str) -> str:
        """Whose frames come, as the service says."""
        _, account = self._accounts.get(glove, (0.0, None))
        return str(account.get("run_id")) if isinstance(account, dict) else ""

    def explain(self, glove: str, rotation: str) -> dict[str, Any]:
        """What one angle of the glove's next pose is made of, as ``pose/explain`` answers.

        Raises QueryRefused with a sentence for a user, NoAnswer, BadName.
        """
        key = GloveKeys(self._settings.site, glove).pose_explain
        name = check_channel_name(rotation, "rotation")
        try:
            return ask_json(self._connected(), f"{key}?rotations={name}", timeout_s=ANSWER_WITHIN_S)
        except QueryRefused as refused:
            raise QueryRefused(str(refused).partition(": ")[2]) from refused

    def close(self) -> None:
        with self._connecting, self._lock:
            for feed, _ in self._feeds.values():
                feed.close()
            self._feeds.clear()
            self._kept.close()
            self._session = None

    def _connected(self) -> zenoh.Session:
        """The session, opened with the first page that needs it."""
        if self._session is not None:
            return self._session
        with self._connecting:
            if self._session is None:
                self._session = self._connect()
            return self._session

    def _connect(self) -> zenoh.Session:
        session = self._kept.enter_context(open_client((self._settings.zenoh,), wait_s=ROUTER_WITHIN_S))
        site, hear = self._settings.site, zenoh.handlers.Callback
        service = all_services(site).removesuffix("alive") + "status"
        self._publishers = Publishers(session, all_gloves(site, "alive"))
        self._kept.callback(self._publishers.close)
        answered: list[threading.Event] = []
        for key, listen in ((all_gloves(site, "status"), self._hear_status), (service, self._hear_account)):
            self._kept.callback(session.declare_subscriber(key, hear(listen, indirect=False)).undeclare)

            def reply(answer: zenoh.Reply, listen: Callable[[zenoh.Sample], None] = listen) -> None:
                if answer.ok is not None:
                    listen(answer.ok)

            answered.append(threading.Event())
            session.get(key, hear(reply, answered[-1].set, indirect=False), timeout=ANSWER_WITHIN_S)
        for each in answered:  # so that a page does not begin with no glove where there is one
            each.wait(FIRST_LOOK_S)
        return session

    def _hear_status(self, sample: zenoh.Sample) -> None:
        status = json_object(sample.payload.to_bytes())
        if status is None:
            return
        with suppress(BadName):
            glove = parse_glove_key(str(sample.key_expr))[0].glove
            if glove in self._heard or self._has_room():
                runs = self._heard.setdefault(glove, {})
                run_id = str(status.get("run_id"))[:32]
                if run_id not in runs and len(runs) >= RUNS_KEPT:
                    del runs[next(run for run in runs if run != self._run_of(glove))]
                runs[run_id] = time.monotonic(), status

    def _has_room(self) -> bool:
        """Gloves that nobody publishes make room."""
        if len(self._heard) >= MOST_GLOVES and self._publishers is not None:
            for glove in [glove for glove in self._heard if not self._publishers.has(glove)]:
                del self._heard[glove]
        return len(self._heard) < MOST_GLOVES

    def _hear_account(self, sample: zenoh.Sample) -> None:
        gloves = (json_object(sample.payload.to_bytes()) or {}).get("gloves")
        for glove, account in gloves.items() if isinstance(gloves, dict) else ():
            if glove in self._accounts or len(self._accounts) < 2 * MOST_GLOVES:
                self._accounts[glove] = time.monotonic(), account
