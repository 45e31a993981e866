"""Bringing a recording to agree with the capture log: what is not in it is fetched, or missing for good.

The glove's capture daemon answers where it stands, and with the frames in its logs. A recording ends when
somebody asked for its end, whether the recorder was running then or not. So its end is a time, by this
computer's clock; the capture log, which has every frame with its time, tells which frame was the last one.
The capture computer's clock may be set meanwhile: so a frame's time is how long before now it was captured,
by the monotonic clock of its computer.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from threading import Event
from typing import Any, Protocol

import zenoh

from glovecal_client.clock import wall_ns
from glovecal_client.errors import NoAnswer, QueryRefused, WireError
from glovecal_client.gap_repair import BlockDigest, fetch_block, fetch_digest
from glovecal_client.keys import GloveKeys
from glovecal_client.session import ask_json
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_service.plain import reason_of
from glovecal_service.recorder.run_ledger import RunBooks, RunLedger

ANSWER_WITHIN_S = 1.0


@dataclass(frozen=True)
class CaptureRun:
    """One start of the capture daemon."""

    run_id: int
    started_wall_ns: int
    """By the capture computer's clock."""
    started_ns: int | None = None
    """By its monotonic clock; None for a run of before the computer was started anew, and where capture does
    not say so."""


@dataclass(frozen=True)
class CaptureStanding:
    """Where the capture daemon stands at this moment."""

    runs: tuple[CaptureRun, ...]
    """Runs whose logs it has, oldest first; the last one is going on."""
    sequence: int
    """The last number given in the run that goes on, -1 before the first."""
    disk_full: bool
    """Numbered frames may be waiting in the daemon's memory for room in its log."""
    clock_ahead_ns: int
    """By how much the capture computer's wall clock is ahead of this one's, at most."""
    at_monotonic_ns: int = 0
    at_wall_ns: int = 0
    """When it said so, by its monotonic clock and by this computer's clock."""
    meta: dict[str, Any] = field(default_factory=dict)
    """What it says of itself and its glove."""

    def time_ns(self, run_id: int, monotonic_ns: int, wall_ns: int) -> int:
        """By this computer's clock as it goes now: the time of what a run did at a time by its two clocks."""
        if any(run.run_id == run_id and run.started_ns is not None for run in self.runs):
            return self.at_wall_ns + monotonic_ns - self.at_monotonic_ns
        return wall_ns - self.clock_ahead_ns

    def frame_ns(self, frame: Frame) -> int:
        return self.time_ns(frame.run_id, frame.monotonic_ns, frame.wall_ns)

    def start_ns(self, run: CaptureRun) -> int:
        return self.time_ns(run.run_id, run.started_ns or 0, run.started_wall_ns)


class CaptureLog:
    """The capture daemon of one glove, over zenoh."""

    def __init__(self, session: zenoh.Session, keys: GloveKeys) -> None:
        self._session = session
        self._keys = keys

    def standing(self) -> CaptureStanding:
        """Raises NoAnswer if nobody answers, or not with a status and a meta."""
        meta = ask_json(self._session, self._keys.meta, timeout_s=ANSWER_WITHIN_S)
        asked_ns = wall_ns()
        status = ask_json(self._session, self._keys.status, timeout_s=ANSWER_WITHIN_S)
        try:
            mine = {**status, "computer": meta.get("computer")}
            last = status["sequence"]
            return CaptureStanding(
                tuple(_run(each, mine) for each in (*meta.get("earlier_runs", ()), mine)),
                -1 if last is None else int(last),
                status.get("disk") == "full",
                # a capture of before this field was there is taken to have this computer's clock
                int(status.get("wall_ns", asked_ns)) - asked_ns,
                int(status.get("monotonic_ns", 0)),
                asked_ns,
                meta,
            )
        except (KeyError, TypeError, ValueError) as error:
            raise NoAnswer(f"{self._keys.status}: the answer is not a capture daemon's") from error

    def block(self, run_id: int, first: int, last: int) -> list[Frame]:
        """The first of the frames ``first`` to ``last`` that the log has, flagged as repaired; [] if none.

        Raises NoAnswer, QueryRefused if the run's log is not there or cannot be read, WireError.
        """
        return fetch_block(self._session, self._keys, run_id, first, last, timeout_s=ANSWER_WITHIN_S)

    def digest(self, run_id: int, first: int, last: int) -> BlockDigest | None:
        """Of the frames that ``block`` would bring; None: the log has none of them.

        Raises as ``block``; QueryRefused also by a capture that gives no digests.
        """
        return fetch_digest(self._session, self._keys, run_id, first, last, timeout_s=ANSWER_WITHIN_S)


def _run(run: Mapping[str, Any], now: Mapping[str, Any]) -> CaptureRun:
    """Raises KeyError, TypeError, ValueError."""
    same_clock = run.get("computer") == now["computer"] and "monotonic_ns" in now and "started_ns" in run
    started_ns = int(run["started_ns"]) if same_clock else None
    return CaptureRun(int(run["run_id"], 16), int(run["started_wall_ns"]), started_ns)


END_OF_RUN = (1 << 63) - 1
TRY_AGAIN_AFTER_S = 0.1
UNANSWERED_FOR_S = 2.0
"""A router that was restarted has everybody back by then."""
REFUSALS = 3
"""So often refused in a row, the frames asked for do not exist any more: their log was removed or damaged."""
WAITING_FOR_ROOM = "the capture computer's disk is full: frames wait there to be logged"


class Log(Protocol):
    """``CaptureLog``, as far as it is needed here."""

    def standing(self) -> CaptureStanding: ...

    def block(self, run_id: int, first: int, last: int) -> list[Frame]: ...

    def digest(self, run_id: int, first: int, last: int) -> BlockDigest | None: ...


class OutOfTime(Exception):
    """The capture log answers, but has more frames to give than could be fetched so far."""


@dataclass(frozen=True)
class Outcome:
    """``complete``: nothing more can come, and what the file lacks is missing for good."""

    complete: bool
    why: str = ""
    """A clause: why it is not complete; or, where it is, what the capture log could not tell."""
    not_compared: str = ""
    """A clause: why what is recorded was not compared with the capture log; "" where it was."""
    may_be_compared: bool = False
    """Whether that is worth another try."""


class Patience:
    """So many seconds from now, or until ``stopped`` is set."""

    def __init__(self, seconds: float, stopped: Event) -> None:
        self._until = time.monotonic() + seconds
        self._stopped = stopped

    @property
    def is_over(self) -> bool:
        return self._stopped.is_set() or time.monotonic() >= self._until

    def wait(self, seconds: float) -> None:
        self._stopped.wait(seconds)


def reconcile(file: RunLedger, log: Log, stop_wall_ns: int | None, patience: Patience) -> Outcome:
    """Fetch what is not in ``file``, as far as the log can be asked.

    ``stop_wall_ns`` is when the end was asked for, by this computer's clock; None: the last frame there is
    ends the recording.
    """
    refusals, unanswered_until = 0, time.monotonic() + UNANSWERED_FOR_S
    while True:
        try:
            _reconcile_once(file, log, stop_wall_ns, patience)
            return Outcome(True)
        except QueryRefused as error:
            why, refusals = str(error), refusals + 1
            if refusals >= REFUSALS:
                return Outcome(True, why)
        except (NoAnswer, WireError, zenoh.ZError) as error:
            why, refusals = reason_of(error), 0
        except OutOfTime:
            return Outcome(False, "the capture log has more to give")
        if patience.is_over or time.monotonic() > unanswered_until:
            return Outcome(False, why)
        patience.wait(TRY_AGAIN_AFTER_S)


def _reconcile_once(file: RunLedger, log: Log, stop_wall_ns: int | None, patience: Patience) -> None:
    """Raises NoAnswer, WireError, OutOfTime; QueryRefused when all else was done."""
    try:
        standing = log.standing()
    except NoAnswer:
        if (stop_wall_ns is None or file.has_ended) and not file.has_gaps:
            return
        raise
    if stop_wall_ns is not None:
        _open_runs_of(file, standing, stop_wall_ns)
    file.note_capture(standing.meta)
    file.note_reached(standing.runs[-1].run_id, standing.sequence)
    refused = None
    for books in list(file.runs.values()):
        try:
            fill_gaps(file, books, log, patience)
            if stop_wall_ns is not None and not books.ended:
                _go_on_to(stop_wall_ns, file, books, log, standing, patience)
        except QueryRefused as error:
            refused = error
    if standing.disk_full and file.has_gaps:
        raise NoAnswer(WAITING_FOR_ROOM)
    if refused is not None:
        raise refused


def _open_runs_of(file: RunLedger, standing: CaptureStanding, stop_wall_ns: int) -> None:
    """The runs that began during the recording, whether a frame of them came or not: all of each."""
    began_ns = file.created_wall_ns
    if file.clock_ahead_ns is None and file.first_frame is not None:  # it began with that one
        began_ns = standing.frame_ns(file.first_frame)
    for run in standing.runs:
        if began_ns < standing.start_ns(run) <= stop_wall_ns:
            file.open_run(run.run_id, run.started_wall_ns)


def fill_gaps(file: RunLedger, books: RunBooks, log: Log, patience: Patience) -> int:
    """Fetch what is missing of a run up to its last frame known, and what of numbers that jumped is there.

    How many came. Raises as ``Log`` does.
    """
    came = sum(_fetch(file, books, log, patience, *gap) for gap in books.missing())
    for gap in books.doubtful():
        came += _fetch(file, books, log, patience, *gap)
        books.note_asked(*gap)
    return came


def _fetch(file: RunLedger, books: RunBooks, log: Log, patience: Patience, first: int, last: int) -> int:
    came = 0
    while first <= last and (block := _block(log, books, first, last, patience)):
        came += sum(file.add(frame, encode_frame(frame)) for frame in block)
        first = block[-1].sequence + 1
    return came


def _go_on_to(
    stop_wall_ns: int,
    file: RunLedger,
    books: RunBooks,
    log: Log,
    standing: CaptureStanding,
    patience: Patience,
) -> None:
    """Fetch what was captured after the last frame known and before the end.

    The log tells where that is: the clock of a frame that came over the wire may be anybody's.
    """
    at = max(books.first, books.last + 1)
    while block := _block(log, books, at, END_OF_RUN, patience):
        for frame in block:
            if standing.frame_ns(frame) > stop_wall_ns:
                return
            file.add(frame, encode_frame(frame))
        at = block[-1].sequence + 1
    newest = books.newest
    if newest.recorded and standing.time_ns(books.run_id, newest.last_ns, books.last_wall_ns) > stop_wall_ns:
        return
    if books.run_id == standing.runs[-1].run_id and standing.sequence > books.last:
        if standing.disk_full:
            raise NoAnswer(WAITING_FOR_ROOM)
        books.note_given(standing.sequence)


def _block(log: Log, books: RunBooks, first: int, last: int, patience: Patience) -> list[Frame]:
    if patience.is_over:
        raise OutOfTime
    return log.block(books.run_id, first, last)
