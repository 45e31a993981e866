"""Which frames of one glove may go on to a model: whole, finite, in order, from one publisher.

Why one may not is counted and logged. Sequence numbers grow within a run, and not faster than a glove can
send. How many frames can lie between two is judged by the frames' own clock: messages that waited, because
this process, its computer or the network stood still, arrive at once.

A number that does not fit is refused. If its publisher means it (it was restarted without a new run id, or
jumped), frames that fit each other follow, and the glove's own frames stay away: then the numbers go on from
there, within a second.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from glovecal_client.errors import WireError
from glovecal_client.plausible_loss import PlausibleLoss
from glovecal_client.wire.frame import Frame, decode_frame
from glovecal_service.logs import Word

LOG_EVERY_S = 10.0

_log = logging.getLogger("glovecal.realtime")


class Refusal(Enum):
    """Reasons; the values stand in the status document."""

    DAMAGED = "damaged"
    UNKNOWN_VERSION = "unknown_version"
    NOT_FINITE = "not_finite"
    DUPLICATE = "duplicate"
    SEQUENCE_BACKWARDS = "sequence_backwards"
    SEQUENCE_JUMP = "sequence_jump"
    TIME_BACKWARDS = "time_backwards"
    SECOND_PUBLISHER = "second_publisher"
    SENSOR_COUNT = "sensor_count"
    OUT_OF_RANGE = "out_of_range"
    NOT_PREDICTABLE = "not_predictable"
    TOO_MANY = "too_many"


class Refused(Exception):
    """A frame that must not reach a model."""

    def __init__(self, reason: Refusal, sentence: str) -> None:
        super().__init__(sentence)
        self.reason = reason


class RefusalCount:
    """Refused frames of one glove by reason; logs the first of a reason and then at most one in 10 s."""

    def __init__(self, glove: str) -> None:
        self._glove = glove
        self._counts: dict[Refusal, int] = {}
        self._logged_at: dict[Refusal, float] = {}
        self.last_sentence = ""

    def add(self, refused: Refused) -> None:
        """Count one frame."""
        reason = refused.reason
        self._counts[reason] = self._counts.get(reason, 0) + 1
        now = time.monotonic()
        if now - self._logged_at.get(reason, -LOG_EVERY_S) >= LOG_EVERY_S:
            self._logged_at[reason] = now
            self.last_sentence = str(refused)
            _log.warning(
                "glove %s: frame refused (%s, %d so far): %s",
                self._glove, Word(reason.value), self._counts[reason], refused,
            )  # fmt: skip

    @property
    def total(self) -> int:
        return sum(self._counts.values())

    def by_reason(self) -> dict[str, int]:
        """Counts of the reasons that occurred."""
        return {reason.value: count for reason, count in list(self._counts.items())}


CONFIRMED_AFTER_NS = 400_000_000
CONFIRMED_BY_FRAMES = 3
SHARE = 4
"""Where frames still follow the known numbers, the others must be so many times as many."""

_TRACKS = 4
_TRACK_BURST = 50


@dataclass(slots=True, eq=False)
class _Track:
    """Refused frames that fit each other."""

    first: int
    last: int
    since_ns: int
    followed_before: int
    """Frames that had followed the known numbers when it began."""
    loss: PlausibleLoss
    last_ns: int
    frames: int = 1

    def begin_again(self, at_ns: int, followed: int) -> None:
        self.first, self.since_ns, self.frames, self.followed_before = self.last, at_ns, 1, followed


class SequenceOrder:
    """Where one publisher stands. ``at_ns`` is when a message arrived, by this process' monotonic clock.

    ``last`` is the newest number that fitted, -1 before the first. Between two frames it counts what never
    arrived; frames that arrived and could not be read (``unread``) may be those whose numbers are missing.
    """

    def __init__(self) -> None:
        self.last = -1
        self.jumps = 0
        """How often the numbers went on somewhere else."""
        self.jumped_to = 0
        """The first of the numbers taken up last; those up to ``last`` were refused until then."""
        self.tried_ns = 0
        """When a number last fitted others that are not confirmed yet: their publisher is there."""
        self._loss = PlausibleLoss(0)
        self._wall_ns = 0
        """Of the newest frame that fitted: the clock that two runs may share."""
        self._followed = 0
        self._tracks: list[_Track] = []
        self._gap = (0, 0, 0)
        """The newest loss: the frame before it, the frame after it, frames missing."""

    def begin(self, frame: Frame, *, unread: int = 0, whole: bool = False) -> int:
        """Start with the first frame of a run; the number of frames missing before it.

        ``whole``: the run began after the last frame that fitted, so its first frames belong to the account.
        """
        missing = max(0, frame.sequence - unread) if whole else 0
        if not PlausibleLoss(self._wall_ns).allows(missing, frame.wall_ns):
            missing = 0
        self._go_on(frame)
        return missing

    def follow(self, frame: Frame, at_ns: int, *, unread: int = 0) -> int:
        """Take the next frame of the run; the number of frames missing before it.

        The number is negative when earlier losses prove wrong: the numbers had gone on from a made-up one.
        Raises Refused for a number that does not fit (yet).
        """
        lost = frame.sequence - self.last - 1
        if lost >= 0:
            missing = lost - unread if lost > unread else 0
            if self._loss.allows(missing, frame.monotonic_ns):
                if missing:
                    self._gap = self.last, frame.sequence, missing
                self.last, self._wall_ns = frame.sequence, frame.wall_ns
                self._followed += 1
                return missing
        return self._track(frame, at_ns, unread)

    def _track(self, frame: Frame, at_ns: int, unread: int) -> int:
        """Note a number that does not fit. Raises Refused unless those like it are confirmed now."""
        track = self._track_of(frame, at_ns)
        if track.frames >= CONFIRMED_BY_FRAMES and at_ns - track.since_ns >= CONFIRMED_AFTER_NS:
            if (self._followed - track.followed_before) * SHARE <= track.frames:
                return self._take_up(track, frame, unread)
            track.begin_again(at_ns, self._followed)
        raise Refused(*self._reason(frame.sequence))

    def _track_of(self, frame: Frame, at_ns: int) -> _Track:
        """The track that the number continues, or a new one in the place of the weakest."""
        sequence = frame.sequence
        for track in sorted(self._tracks, key=lambda track: track.last, reverse=True):
            if track.last == sequence:
                return track
            if track.last < sequence and track.loss.allows(sequence - track.last - 1, frame.monotonic_ns):
                track.last, track.last_ns, track.frames = sequence, at_ns, track.frames + 1
                if track.frames >= CONFIRMED_BY_FRAMES:
                    self.tried_ns = at_ns
                return track
        if len(self._tracks) >= _TRACKS:
            late_ns = at_ns - CONFIRMED_AFTER_NS
            self._tracks.remove(min(self._tracks, key=lambda track: (track.last_ns > late_ns, track.frames)))
        loss = PlausibleLoss(frame.monotonic_ns, _TRACK_BURST)
        track = _Track(sequence, sequence, at_ns, self._followed, loss, at_ns)
        self._tracks.append(track)
        return track

    def _take_up(self, track: _Track, frame: Frame, unread: int) -> int:
        """``frame`` is the newest of the track."""
        missing = max(0, track.last - track.first + 1 - track.frames - unread)
        before, after, wrong = self._gap
        if before < track.first < after:  # what looked lost was still to come
            missing += track.first - before - 1 - wrong
        self.jumps += 1
        self.jumped_to = track.first
        self._go_on(frame)
        return missing

    def _go_on(self, frame: Frame) -> None:
        self.last, self._wall_ns = frame.sequence, frame.wall_ns
        self._followed += 1
        self._loss = PlausibleLoss(frame.monotonic_ns)
        self._tracks.clear()
        self._gap = (0, 0, 0)

    def _reason(self, sequence: int) -> tuple[Refusal, str]:
        if sequence == self.last:
            return Refusal.DUPLICATE, f"sequence number {sequence} came twice"
        if sequence < self.last:
            return Refusal.SEQUENCE_BACKWARDS, f"sequence number {sequence} came after {self.last}"
        sentence = f"sequence number {sequence} came after {self.last}: no glove sends frames that fast"
        return Refusal.SEQUENCE_JUMP, sentence


TAKEOVER_AFTER_NS = 500_000_000
"""A publisher keeps its glove until it was silent this long; then another run may take it over."""

_VERSION_AT = 4
_KNOWN_VERSION = 1
_REFUSED_RUNS = 8


class Place(NamedTuple):
    """How far a run was at one moment."""

    run_id: int
    sequence: int
    """The last number given, -1 before the first."""
    at_ns: int
    """When this process heard of it, by its monotonic clock."""
    wall_ns: int
    """The same moment by the capture computer's clock; 0 where that is not known."""


class Standing(NamedTuple):
    """How far a glove is, all of one moment: what other threads may read."""

    newest: Place
    """The newest frame in order."""
    missing: int
    """Frames that were sent until then, as the numbers of those that passed tell, and never arrived."""
    messages: int
    """All that arrived until then."""
    began: Place
    """The first frame of all."""
    ended: Place | None
    """The newest frame of the run before this one."""


class FrameGate:
    """Lets the frames of one glove pass or raises Refused; ``run_id`` and ``sequence`` tell where it stands.

    Sequence numbers must grow within a run, as ``SequenceOrder`` says. A clock that stepped back costs the
    frame at the step, not all that follow. Another run may begin after the present one was silent for half
    a second.
    """

    def __init__(self) -> None:
        self.run_id: int | None = None
        self.runs = 0
        """How many runs began so far; grows when another publisher takes over."""
        self.standing: Standing | None = None
        """None before the first frame."""
        self._missing = self._messages = 0
        self._passed_at_ns = 0
        self._order = SequenceOrder()
        self._monotonic_ns = 0
        self._unread = 0
        """Messages since then of which nobody knows the number."""
        self._refused_of_run: dict[int, int] = {}

    @property
    def sequence(self) -> int:
        """The number of the newest frame in order, -1 before the first."""
        return self._order.last

    @property
    def jumps(self) -> int:
        """How often a publisher went on with other numbers in the same run."""
        return self._order.jumps

    def note_unread(self, count: int) -> None:
        """So many messages came before the next one for ``pass_frame`` and are thrown away without a look."""
        self._messages += count
        self._unread += count

    def note_strange(self, count: int) -> None:
        """So many messages came that are not of the run, and are thrown away without a look."""
        self._messages += count

    def pass_frame(self, message: bytes, received_ns: int) -> Frame:
        """The frame in ``message``, received at ``received_ns`` of this process' monotonic clock."""
        self._messages += 1
        try:
            frame = decode_frame(message)
        except WireError as error:
            self._unread += 1
            raise Refused(_reason(message, error), str(error)) from error
        known, newest = self.standing, Place(frame.run_id, frame.sequence, received_ns, frame.wall_ns)
        if known is None or frame.run_id != self.run_id:
            self._begin_run(frame, received_ns)
            began, ended = (newest, None) if known is None else (known.began, known.newest)
        else:
            began, ended = known.began, known.ended
            self._missing += self._order.follow(frame, received_ns, unread=self._unread)
        self._unread = 0
        self.standing = Standing(newest, self._missing, self._messages, began, ended)
        before, self._monotonic_ns = self._monotonic_ns, frame.monotonic_ns
        if frame.monotonic_ns <= before:
            raise Refused(
                Refusal.TIME_BACKWARDS,
                f"frame {frame.sequence} went back in time by {(before - frame.monotonic_ns) / 1e9:.6f} s",
            )
        self._passed_at_ns = received_ns
        return frame

    def _begin_run(self, frame: Frame, received_ns: int) -> None:
        there_ns = max(self._passed_at_ns, self._order.tried_ns)
        if self.run_id is not None and received_ns - there_ns <= TAKEOVER_AFTER_NS:
            self._note_refused_run(frame.run_id)
            raise Refused(
                Refusal.SECOND_PUBLISHER,
                f"run {frame.run_id:016x} publishes while run {self.run_id:016x} has the glove; stop one",
            )
        unread = self._unread + self._refused_of_run.pop(frame.run_id, 0)
        self._missing += self._order.begin(frame, unread=unread, whole=self.standing is not None)
        self.run_id = frame.run_id
        self.runs += 1
        self._monotonic_ns = frame.monotonic_ns - 1  # clocks of two runs cannot be compared

    def _note_refused_run(self, run_id: int) -> None:
        """Count a frame that a run lost because another had the glove; of a few runs only."""
        if run_id not in self._refused_of_run and len(self._refused_of_run) >= _REFUSED_RUNS:
            self._refused_of_run.clear()
        self._refused_of_run[run_id] = self._refused_of_run.get(run_id, 0) + 1


def _reason(message: bytes, error: WireError) -> Refusal:
    if (
        message[:_VERSION_AT] == b"GLVF"
        and len(message) > _VERSION_AT
        and message[_VERSION_AT] != _KNOWN_VERSION
    ):
        return Refusal.UNKNOWN_VERSION
    # the format refuses numbers only after it has found the message whole and its checksum right
    return Refusal.NOT_FINITE if "finite" in str(error) else Refusal.DAMAGED
