"""Poses of one glove for an animation tool: always the newest, never a queue, and honest about silence.

The stream is accounted for exactly: what came, what never came, what the service skipped.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import zenoh

from glovecal_client.clock import clock_ns
from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.keys import GloveKeys
from glovecal_client.plausible_loss import PlausibleLoss
from glovecal_client.session import ask_json, json_object
from glovecal_client.wire.pose import Pose, decode_pose

_BEGINS_AGAIN = 3
"""Poses in a row."""
_TERM_LASTS_NS = 1_000_000_000
"""For so long after a pose those of an earlier term are late; later they are of a service that began anew."""


@dataclass(frozen=True)
class PoseCounts:
    """What a subscriber has seen since it started."""

    received: int = 0
    """Poses taken, one per frame."""
    skipped: int = 0
    """Frames the service says it skipped, on purpose, to stay current."""
    lost: int = 0
    """Frames with neither a pose nor a skip: lost between the service and here, or before the service."""
    repeated: int = 0
    """Poses for a frame that was already shown or overtaken, or by a process that had lost the glove;
    ignored."""
    damaged: int = 0
    """Messages that were no whole pose; ignored."""
    runs: int = 0
    """Starts of the capture daemon seen, 1 in an undisturbed session."""


class PoseOrder:
    """Sorts poses into new ones and repeated ones, and counts. Not for several threads at once."""

    def __init__(self) -> None:
        self._last: Pose | None = None
        self._again: list[int] = []
        self._received = self._skipped = self._gaps = self._repeated = self._damaged = self._runs = 0

    def accept(self, pose: Pose) -> bool:
        """Whether the pose is to be shown: newer than all before, or a first notice that it is stale."""
        last = self._last
        if last is not None and _is_overruled(pose, last):
            self._repeated += 1
            return False
        if last is None or pose.run_id != last.run_id:
            self._runs += 1
            if pose.stale:  # a repetition of a frame from before this subscriber listened
                self._last = pose
                return True
        elif pose.sequence == last.sequence and pose.stale and not last.stale:
            self._last = pose
            return True
        elif pose.sequence <= last.sequence and not self._begins_again(pose):
            self._repeated += 1
            return False
        else:
            self._note_gap(last, pose)
        self._again.clear()
        self._received += 1
        self._last = pose
        return True

    def _begins_again(self, pose: Pose) -> bool:
        """Whether the glove's numbers went on from a lower one: a few poses in a row, each above the last.

        The service lets no lower number pass otherwise, so poses that were overtaken do not come like that.
        """
        if pose.stale or (self._again and pose.sequence <= self._again[-1]):
            self._again.clear()
        if not pose.stale:
            self._again.append(pose.sequence)
        return len(self._again) >= _BEGINS_AGAIN

    def _note_gap(self, last: Pose, pose: Pose) -> None:
        """Count the frames between two poses, unless the glove's numbers jumped."""
        between = pose.sequence - last.sequence - 1
        if between >= 0 and PlausibleLoss(last.monotonic_ns).allows(between, pose.monotonic_ns):
            self._gaps += between
            self._skipped += max(0, pose.skipped - last.skipped)

    def note_damage(self) -> None:
        """Count a message that could not be decoded."""
        self._damaged += 1

    def counts(self) -> PoseCounts:
        """The counts of this moment."""
        lost = max(0, self._gaps - self._skipped)
        return PoseCounts(self._received, self._skipped, lost, self._repeated, self._damaged, self._runs)


def _is_overruled(pose: Pose, last: Pose) -> bool:
    """Whether another process had taken the glove over when ``pose`` was made."""
    return pose.term < last.term and pose.wall_ns - last.wall_ns < _TERM_LASTS_NS


STALE_AFTER_S = 0.5
_LOG = logging.getLogger(__name__)


class PoseSubscriber:
    """Subscribes to one glove's poses, latest wins: a slow reader misses poses, it never gets old ones.

    Use it in one of three ways: ``latest`` (a tool with a draw loop), ``wait`` or iteration (a loop of one's
    own), or ``on_pose`` (called in a thread of the subscriber's own, so it may take its time; what it raises
    is logged and the next pose is given). Close it, or use a ``with`` block, before closing the session.
    """

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        glove: str,
        *,
        on_pose: Callable[[Pose], None] | None = None,
        stale_after_s: float = STALE_AFTER_S,
    ) -> None:
        """Raises BadName for a site or glove that cannot be."""
        self._session = session
        self._keys = GloveKeys(site, glove)
        self._stale_after_s = stale_after_s
        self._changed = threading.Condition()
        self._order = PoseOrder()
        self._latest: Pose | None = None
        self._latest_at = 0
        self._fresh = False
        self._meta: dict[str, Any] | None = None
        self._closed = False
        hear_pose = zenoh.handlers.Callback(self._hear_pose, indirect=False)
        hear_meta = zenoh.handlers.Callback(self._hear_meta, indirect=False)
        self._subscribers = [
            session.declare_subscriber(self._keys.pose_meta, hear_meta),
            session.declare_subscriber(self._keys.pose, hear_pose),
        ]
        self._caller: threading.Thread | None = None
        if on_pose is not None:
            self._caller = threading.Thread(target=self._call, args=(on_pose,), name="poses", daemon=True)
            self._caller.start()

    @property
    def latest(self) -> Pose | None:
        """The newest pose, None before the first. Look at ``stale`` before using it."""
        with self._changed:
            return self._latest

    @property
    def stale(self) -> bool:
        """Nothing came for half a second (or ever), or the service says that the glove is silent."""
        with self._changed:
            pose = self._latest
            return pose is None or pose.stale or clock_ns() - self._latest_at > 1e9 * self._stale_after_s

    @property
    def counts(self) -> PoseCounts:
        """What came and what did not."""
        with self._changed:
            return self._order.counts()

    def wait(self, timeout_s: float) -> Pose | None:
        """The newest pose not yet given by ``wait`` or iteration, None if there was none in time."""
        arrived = self.wait_arrival(timeout_s)
        return None if arrived is None else arrived[0]

    def wait_arrival(self, timeout_s: float) -> tuple[Pose, int] | None:
        """As ``wait``, with the moment at which the pose arrived here, ``clock_ns``."""
        with self._changed:
            self._changed.wait_for(lambda: self._fresh or self._closed, timeout_s)
            if not self._fresh or self._latest is None:
                return None
            self._fresh = False
            return self._latest, self._latest_at

    def __iter__(self) -> Iterator[Pose]:
        """Newest poses as they come, until the subscriber is closed."""
        while not self._closed:
            pose = self.wait(self._stale_after_s)
            if pose is not None:
                yield pose

    def meta(self, pose: Pose, *, timeout_s: float = 2.0) -> dict[str, Any]:
        """``pose/meta`` as it was said of this pose's model: names of its rotations, hand, skeleton.

        The same object until another is said. Asks the service if what is known is of another model; raises
        NoAnswer while nobody says what this pose's numbers are.
        """
        meta = self._meta
        if meta is None or not _is_of(meta, pose):
            meta = self._meta = ask_json(self._session, self._keys.pose_meta, timeout_s=timeout_s)
            if not _is_of(meta, pose):
                raise NoAnswer(
                    f"{self._keys.pose_meta}: the names given are for model {meta.get('model')!r}, "
                    f"the pose is of {pose.model_sha256!r} with {len(pose.degrees)} rotations"
                )
        return meta

    def rotations(self, pose: Pose, *, timeout_s: float = 2.0) -> tuple[str, ...]:
        """Names of the pose's rotations, in order. Raises NoAnswer as ``meta``."""
        return tuple(str(name) for name in self.meta(pose, timeout_s=timeout_s)["rotations"])

    def explanation(self) -> str:
        """Why the glove is served as it is: why without a model, or not with the newest; "" if all is well.

        Asks the service the first time, and knows it from then on.
        """
        if self._meta is None:
            with suppress(NoAnswer):
                self._meta = ask_json(self._session, self._keys.pose_meta, timeout_s=2.0)
        return str((self._meta or {}).get("sentence", ""))

    def angles(self, pose: Pose) -> dict[str, float]:
        """Rotations by name, in degrees; empty when uncalibrated. Raises NoAnswer as ``rotations``."""
        if not len(pose.degrees):
            return {}
        return dict(zip(self.rotations(pose), pose.degrees.tolist(), strict=True))

    def close(self) -> None:
        """Stop listening; waiting readers get None. Not to be called from ``on_pose``."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        for subscriber in self._subscribers:
            subscriber.undeclare()
        self._subscribers = []
        if self._caller is not None:
            self._caller.join()
            self._caller = None

    def __enter__(self) -> PoseSubscriber:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _hear_pose(self, sample: zenoh.Sample) -> None:
        """On zenoh's own thread: take the message in and return at once."""
        message = sample.payload.to_bytes()
        try:
            pose = decode_pose(message)
        except WireError:
            with self._changed:
                self._order.note_damage()
            return
        with self._changed:
            if self._order.accept(pose):
                self._latest, self._latest_at, self._fresh = pose, clock_ns(), True
                self._changed.notify_all()

    def _hear_meta(self, sample: zenoh.Sample) -> None:
        meta = json_object(sample.payload.to_bytes())
        if meta is not None:
            self._meta = meta

    def _call(self, on_pose: Callable[[Pose], None]) -> None:
        for pose in self:
            try:
                on_pose(pose)
            except Exception:
                _LOG.exception("%s: on_pose failed for frame %d", self._keys.pose, pose.sequence)


def _is_of(meta: dict[str, Any], pose: Pose) -> bool:
    """Whether ``meta`` tells what the numbers of ``pose`` are: of the same model, one name each."""
    names = meta.get("rotations")
    fits = isinstance(names, list) and len(names) == len(pose.degrees)
    return fits and meta.get("model") == pose.model_sha256
