"""What every live bridge shares: poses arrive, are named, leave at once, and are never kept for later.

Each glove has a thread that waits for its newest pose. When nothing comes for half a second, or the service
says that the glove is silent, the last pose is handed on marked stale, and again until poses come. A router
that dies is found again by zenoh; a receiver that dies is the bridge's own affair.
"""

from __future__ import annotations

import logging
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from types import TracebackType
from typing import Any, ClassVar

import zenoh

from glovecal_client.clock import clock_ns, computer_id
from glovecal_client.errors import BadName, NoAnswer
from glovecal_client.keys import GloveKeys, all_gloves, parse_glove_key
from glovecal_client.pose_subscriber import STALE_AFTER_S, PoseSubscriber
from glovecal_client.session import ask_json
from glovecal_client.wire.pose import Pose, PoseFlag
from glovecal_models.errors import BadInput
from glovecal_models.installation import not_installed
from glovecal_models.names import did_you_mean
from glovecal_service.bridges.glove_pose import GlovePose, PoseMeaning
from glovecal_service.bridges.traffic import Traffic

LOOPBACK = "127.0.0.1"
GIL_SWITCH_S = 0.0005
"""Longest time another thread of a bridge's process keeps a pose waiting."""
MOST_GLOVES = 16
"""That are followed where none was named."""
_ASK_AGAIN_NS = 1_000_000_000
_META_WITHIN_S = 0.5
_log = logging.getLogger("glovecal.bridge")


@dataclass(frozen=True)
class BridgeOptions:
    """What a person asked for: of each bridge only those that its ``options`` name."""

    to: str | None = None
    port: int | None = None
    more: Mapping[str, str] = field(default_factory=dict)
    """KEY=VALUE."""

    def check(self, name: str, known: Mapping[str, str]) -> None:
        """Raises BadInput for one that the bridge ``name`` does not have."""
        given = [word for word, value in (("to", self.to), ("port", self.port)) if value is not None]
        for word in (*given, *self.more):
            if word not in known:
                raise BadInput(f"bridge {name} has no option {word!r}; {did_you_mean(word, known)}")

    def address(self, default: str) -> tuple[str, int]:
        """Host and port of ``to``. Raises BadInput."""
        host, _, port = (self.to or default).rpartition(":")
        if not host or not port.isdigit() or not 0 < int(port) < 65536:
            raise BadInput(f"--to {self.to!r} is no address; give HOST:PORT, as in {default}")
        return host, int(port)

    def number(self, key: str, default: int, low: int, high: int) -> int:
        """Raises BadInput for what is no whole number from ``low`` to ``high``."""
        value = self.more.get(key, str(default))
        if not value.isdigit() or not low <= int(value) <= high:
            raise BadInput(f"option {key} is {value!r}; give a whole number from {low} to {high}")
        return int(value)


class Bridge(ABC):
    """Sends poses somewhere. Entered once; ``send`` is called from one thread at a time."""

    about: ClassVar[str]
    """Which tools read it, a clause."""
    to_set_there: ClassVar[str]
    """What a person sets in such a tool, a clause."""
    units: ClassVar[str]
    """And axes, and which way is up."""
    when_stale: ClassVar[str]
    """What a receiver gets in place of live poses, a clause."""
    options: ClassVar[dict[str, str]]
    """Name and explanation; ``to`` and ``port`` are --to and --port."""
    needs: ClassVar[tuple[str, str] | None] = None
    """Module and package of an extra, where it needs one."""

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        """Raises BadInput for options that cannot be."""
        self._options = options
        self._traffic = traffic

    @property
    @abstractmethod
    def where(self) -> str:
        """Where receivers find it, a sentence; known once it is entered."""

    @property
    def receivers(self) -> int | None:
        """How many there are now; None where that cannot be known."""
        return None

    @abstractmethod
    def send(self, hand: GlovePose) -> None:
        """Hand a pose on without waiting for any receiver; tell ``Traffic`` when it has left, or has not.

        Poses that are not live come too, again and again: a bridge says so in its format.
        """

    @abstractmethod
    def __enter__(self) -> Bridge:
        """Open what it sends with. Raises BadInput where that is not possible."""

    @abstractmethod
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    @classmethod
    def require_installed(cls, name: str) -> None:
        """Raises BadInput with the command that installs what is missing."""
        if cls.needs is not None and find_spec(cls.needs[0]) is None:
            raise BadInput(not_installed(f"bridge {name}", cls.needs[1]))


class LiveGloves:
    """Hands the poses of gloves to a bridge, from entering to leaving the ``with`` block."""

    def __init__(
        self, session: zenoh.Session, site: str, gloves: Sequence[str], bridge: Bridge, traffic: Traffic
    ) -> None:
        """``gloves``: none named means all that send poses, at most ``MOST_GLOVES``."""
        self._session, self._site, self._bridge, self._traffic = session, site, bridge, traffic
        self._named = tuple(dict.fromkeys(gloves))
        self._feeds: dict[str, _GloveFeed] = {}
        self._sending, self._news = threading.Lock(), threading.Condition()
        self._appeared: list[str] = []
        self._is_over = False
        self._finder: threading.Thread | None = None
        self._subscriber: zenoh.Subscriber[Any] | None = None

    def __enter__(self) -> LiveGloves:
        for glove in self._named:
            self._follow(glove)
        if not self._named:
            self._finder = threading.Thread(target=self._follow_new, name="new gloves", daemon=True)
            self._finder.start()
            handler = zenoh.handlers.Callback(self._note_glove, indirect=False)
            self._subscriber = self._session.declare_subscriber(all_gloves(self._site, "pose"), handler)
        return self

    def __exit__(self, *_: object) -> None:
        if self._subscriber is not None:
            self._subscriber.undeclare()
        with self._news:
            self._is_over = True
            self._news.notify()
        if self._finder is not None:
            self._finder.join()
        for feed in self._feeds.values():
            feed.close()

    def _note_glove(self, sample: zenoh.Sample) -> None:
        """On zenoh's thread."""
        glove = str(sample.key_expr).split("/")[2]
        if glove not in self._feeds and glove not in self._appeared:
            with self._news:
                self._appeared.append(glove)
                self._news.notify()

    def _follow_new(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._is_over or self._appeared)
                if self._is_over:
                    return
                glove = self._appeared.pop()
            try:
                parse_glove_key(GloveKeys(self._site, glove).pose)
            except BadName:
                continue
            if glove not in self._feeds and len(self._feeds) < MOST_GLOVES:
                self._follow(glove)

    def _follow(self, glove: str) -> None:
        feed = _GloveFeed(self._session, self._site, glove, self._bridge, self._traffic, self._sending)
        self._feeds[glove] = feed
        feed.start()


class _GloveFeed:
    """The thread that waits for one glove's poses."""

    def __init__(
        self, session: zenoh.Session, site: str, glove: str, bridge: Bridge, traffic: Traffic,
        sending: threading.Lock,
    ) -> None:  # fmt: skip
        self._session, self._keys = session, GloveKeys(site, glove)
        self._bridge, self._traffic, self._sending = bridge, traffic, sending
        self._poses = PoseSubscriber(session, site, glove)
        self._last: GlovePose | None = None
        self._meaning: PoseMeaning | None = None
        self._not_before_ns = 0
        self._computer_of: tuple[int, bool] | None = None
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"poses of {glove}", daemon=True)
        traffic.add_glove(glove, lambda: self._poses.counts)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._is_over.set()
        self._poses.close()
        self._thread.join()

    def _run(self) -> None:
        while not self._is_over.is_set():
            arrival = self._poses.wait_arrival(STALE_AFTER_S)
            hand = self._silent() if arrival is None else self._understood(*arrival)
            if hand is None or self._is_over.is_set():
                continue
            self._traffic.note_taken(hand, is_new=arrival is not None)
            try:
                with self._sending:
                    self._bridge.send(hand)
            except Exception:  # one pose's trouble must not end the stream
                _log.exception("glove %s: frame %d was not sent", hand.glove, hand.pose.sequence)
                self._traffic.note_left_out(hand.glove)

    def _silent(self) -> GlovePose | None:
        """The last pose once more, marked stale; None before the first."""
        if self._last is None or not self._poses.stale:
            return None
        pose = self._last.pose
        return replace(self._last, pose=replace(pose, flags=pose.flags | PoseFlag.STALE))

    def _understood(self, pose: Pose, arrived_ns: int) -> GlovePose | None:
        """With the meaning of its numbers; None while nobody says that, which is asked once a second."""
        if clock_ns() < self._not_before_ns:
            return None
        try:
            document = self._poses.meta(pose)
        except NoAnswer as error:
            _log.warning("glove %s: %s", self._keys.glove, error)
            self._not_before_ns = clock_ns() + _ASK_AGAIN_NS
            return None
        if self._meaning is None or self._meaning.document is not document:
            self._meaning = PoseMeaning(document)
            if self._meaning.problem:
                _log.warning("glove %s: %s", self._keys.glove, self._meaning.problem)
        is_of_this = self._is_of_this_computer(pose.run_id)
        self._last = GlovePose(self._keys.glove, pose, self._meaning, arrived_ns, is_of_this)
        return self._last

    def _is_of_this_computer(self, run_id: int) -> bool:
        """Whether the glove is captured here, asked once a run."""
        if self._computer_of is None or self._computer_of[0] != run_id:
            try:
                meta = ask_json(self._session, self._keys.meta, timeout_s=_META_WITHIN_S)
            except NoAnswer:
                meta = {}
            self._computer_of = run_id, meta.get("computer") == computer_id()
        return self._computer_of[1]
