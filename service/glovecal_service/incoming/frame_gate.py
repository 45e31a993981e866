"""Which frames of one glove may go on to a model: whole, finite, in order, from one publisher."""

from __future__ import annotations

from typing import NamedTuple

from glovecal_client.errors import WireError
from glovecal_client.wire.frame import Frame, decode_frame
from glovecal_service.incoming.refusal import Refusal, Refused
from glovecal_service.incoming.sequence_order import SequenceOrder

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
