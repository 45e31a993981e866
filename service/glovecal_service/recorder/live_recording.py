"""One recording while it goes on: frames in, gaps repaired, and at its end the exact account."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from threading import Event
from typing import Any

import zenoh

from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.keys import GloveKeys
from glovecal_client.plausible_loss import PlausibleLoss
from glovecal_client.publishers import Publishers
from glovecal_client.session import json_object
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_service.incoming.arrivals import Arrivals
from glovecal_service.incoming.frame_gate import TAKEOVER_AFTER_NS, Refusal, Refused, SequenceOrder
from glovecal_service.recorder.log_comparison import reconcile_and_compare
from glovecal_service.recorder.pre_roll import PreRoll, PreRollRequest
from glovecal_service.recorder.reconciliation import CaptureLog, OutOfTime, Patience, fill_gaps
from glovecal_service.recorder.recording_result import Settlement, recording_account
from glovecal_service.recorder.run_books import OWN_CLOCK
from glovecal_service.recorder.run_ledger import RunLedger, decoded
from glovecal_service.store.recordings import PRE_ROLL

WAITING_LIMIT, STATUSES_LIMIT = 65536, 1024
STATUSES_READ = 16
"""Of those that wait at a look, the newest."""
HELD_LIMIT = 1024
"""Frames with numbers that do not fit yet."""
REPAIR_AFTER_S = 0.5
"""A gap this old is asked for; a shorter one may still be on its way."""
ON_THE_WAY_S = 0.05
"""Frames captured just before the stop arrive within this time; what takes longer is fetched."""


class LiveRecording:
    """Reads its glove's frames by a subscription of its own, which cannot hold up anybody else.

    It listens before ``open_file`` says where the recording begins, so that no frame is lost in between. The
    pre-roll is fetched once a frame is there to lead to.
    """

    def __init__(self, session: zenoh.Session, keys: GloveKeys, open_file: Callable[[], RunLedger]) -> None:
        """Raises what ``open_file`` raises."""
        self.keys = keys
        self.refused = 0
        """Messages of a second publisher, damaged ones, and numbers that no glove can have reached."""
        self._session = session
        self._pre_roll: PreRoll | None = None
        self._run_id: int | None = None
        self._heard_ns = 0
        self._order = SequenceOrder()
        self._held: deque[tuple[Frame, bytes, bool]] = deque(maxlen=HELD_LIMIT)
        """Frames with their messages, and whether they were counted as refused."""
        self._repair_at = 0.0
        self._met = False
        """Whether a frame has come."""
        self._is_after_the_end: Callable[[Frame], bool] = lambda _: False
        """Once its end was asked for, and as far as capture's clock is known."""
        self._log = CaptureLog(session, keys)
        self._arrivals = Arrivals(session, keys.raw, limit=WAITING_LIMIT)
        self._statuses = Arrivals(session, keys.status, limit=STATUSES_LIMIT)
        self._publishers = Publishers(session, keys.alive)
        try:
            self.file = open_file()
        except BaseException:
            self._close_arrivals()
            raise
        self._wish = PreRollRequest.of_document(self.file.meta.get(PRE_ROLL))

    def take_in(self) -> None:
        """Write what arrived since the last call."""
        for arrival in self._arrivals.drain():
            self._record(arrival.payload, arrival.received_ns)
        statuses = self._statuses.drain()[-STATUSES_READ:]
        if statuses and self._publishers.has(self.keys.glove):
            for arrival in statuses:
                self._note_status(json_object(arrival.payload) or {}, arrival.received_ns)

    def _note_status(self, status: dict[str, Any], received_ns: int) -> None:
        """The last status of a run says how far it came; once capture is gone nobody can be asked.

        One of another run than those recorded is not the glove's.
        """
        books = next(
            (each for each in self.file.runs.values() if f"{each.run_id:016x}" == status.get("run_id")), None
        )
        if books is None:
            return
        last, own = status.get("sequence"), status.get(OWN_CLOCK)
        if isinstance(own, dict):
            books.own_clock = own
        if status.get("state") != "stopped" or not isinstance(last, int):
            return
        if PlausibleLoss(self._heard_ns).allows(max(0, last - books.last), received_ns):
            books.note_given(last)
            books.ended = True
            self.file.note_reached(books.run_id, last)

    def take_pre_roll(self) -> None:
        """Write what was fetched of the pre-roll since the last call; never waits."""
        if self._pre_roll is None:
            self._pre_roll = self._begin_pre_roll()
        else:
            self._write_some(self._pre_roll)

    def _begin_pre_roll(self) -> PreRoll | None:
        first, oldest = self.file.first_frame, self.file.oldest_frame
        if first is None or oldest is None or not self._wish.most_s:
            return None
        from_ns = first.monotonic_ns - round(self._wish.most_s * 1e9)
        return PreRoll(self._session, self.keys, oldest, from_ns)

    def _write_some(self, pre_roll: PreRoll) -> None:
        frames = pre_roll.take()
        if frames and not self.file.has_room_to_spare:
            pre_roll.stop("the disk is nearly full")
            return
        for frame in frames:
            self.file.add(frame, encode_frame(frame))

    def _record(self, message: bytes, received_ns: int) -> None:
        frame = decoded(message)
        if frame is None:
            self.refused += 1
            return
        if self._is_after_the_end(frame):
            return
        silent = received_ns - self._heard_ns > TAKEOVER_AFTER_NS
        if frame.run_id != self._run_id and self._run_id is not None and not silent:
            self.refused += 1
            return
        begins = frame.run_id != self._run_id
        self._run_id, self._heard_ns = frame.run_id, received_ns
        if begins:
            self._order.begin(frame)
            self.file.add(frame, message)
        else:
            self._record_in_order(frame, message, received_ns)

    def _record_in_order(self, frame: Frame, message: bytes, received_ns: int) -> None:
        """Record a frame that fits; hold one that does not until it is clear whether its publisher jumped."""
        jumps = self._order.jumps
        try:
            self._order.follow(frame, received_ns)
        except Refused as refused:
            if self.file.lacks(frame):
                self.file.add(frame, message)
            elif refused.reason is not Refusal.DUPLICATE:
                is_new = not self.file.has(frame)
                self.refused += is_new
                self._held.append((frame, message, is_new))
            return
        if self._order.jumps != jumps:
            self._record_jump(frame, message)
        else:
            self.file.add(frame, message)
        self._held.clear()

    def _record_jump(self, frame: Frame, message: bytes) -> None:
        """Record the frames that confirmed each other; the last of them is ``frame``."""
        first = self._order.jumped_to
        held = [item for item in self._held if first <= item[0].sequence < frame.sequence]
        self.refused -= sum(is_new for _, _, is_new in held)
        for each, bytes_of_it, _ in [*held, (frame, message, True)]:
            self.file.add(each, bytes_of_it)

    def repair_now_and_then(self) -> None:
        """Twice a second at most, ask capture for what is missing, and who it is if it did not say so.

        The first frame asks at once: a capture that ends within half a second cannot be asked any more.
        """
        now = time.monotonic()
        met, self._met = self._met, self.file.first_frame is not None
        if now < self._repair_at and met == self._met:
            return
        self._repair_at = now + REPAIR_AFTER_S
        if not self.file.capture and self.file.first_frame is not None:
            with suppress(NoAnswer):
                self.file.note_capture(self._log.standing().meta)
        if not self._repair(Patience(REPAIR_AFTER_S, Event())) and self.file.has_gaps:
            self._repair_at = now + 10 * REPAIR_AFTER_S

    def _repair(self, patience: Patience) -> bool:
        """Fetch missing frames; whether some came."""
        before = sum(books.recorded_frames for books in self.file.runs.values())
        with suppress(NoAnswer, WireError, OutOfTime):
            for books in list(self.file.runs.values()):
                fill_gaps(self.file, books, self._log, patience)
        return sum(books.recorded_frames for books in self.file.runs.values()) > before

    def finish(self, stop_wall_ns: int | None, patience: Patience) -> Settlement:
        """Stop: fetch or wait for everything captured up to the stop, close the file; as in ``reconcile``."""
        patience.wait(ON_THE_WAY_S)
        if stop_wall_ns is not None:
            with suppress(NoAnswer):
                standing = self._log.standing()
                self._is_after_the_end = lambda frame: standing.frame_ns(frame) > stop_wall_ns
        self._stop_listening()
        outcome = reconcile_and_compare(self.file, self._log, stop_wall_ns, patience)
        self._finish_pre_roll(patience)
        self.file.close()
        return Settlement.of(self.file, outcome, refused=self.refused, why_shorter=self._why_shorter())

    def _finish_pre_roll(self, patience: Patience) -> None:
        self.take_pre_roll()
        while self._pre_roll is not None and self._pre_roll.goes_on and not patience.is_over:
            self._write_some(self._pre_roll)
            time.sleep(0.01)
        if self._pre_roll is not None:
            self._pre_roll.stop()

    def abandon(self) -> None:
        """Close the file as it is; a later process resumes it."""
        self._stop_listening()
        if self._pre_roll is not None:
            self._pre_roll.stop()
            self._pre_roll.wait()
        self.file.close()

    def _stop_listening(self) -> None:
        self._close_arrivals()
        self.take_in()

    def _close_arrivals(self) -> None:
        self._arrivals.close()
        self._statuses.close()
        self._publishers.close()

    def account(self) -> dict[str, Any]:
        """Facts for the recording's row while it goes on."""
        return recording_account(
            self.file, complete=False, refused=self.refused, why_shorter=self._why_shorter()
        )

    def _why_shorter(self) -> str | None:
        if self._pre_roll is not None:
            return self._pre_roll.why_shorter
        return "no frame has come yet" if self.file.first_frame is None else None
