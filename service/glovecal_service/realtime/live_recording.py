"""One recording while it goes on: frames in, gaps repaired, and at its end the exact account."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import zenoh

from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.gap_repair import fetch_frames
from glovecal_client.keys import GloveKeys
from glovecal_client.queries import ask_json
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_service.realtime.arrivals import Arrivals
from glovecal_service.realtime.frame_gate import TAKEOVER_AFTER_NS
from glovecal_service.realtime.lead_in import LeadIn
from glovecal_service.realtime.lead_in_wish import LeadInWish
from glovecal_service.realtime.recording_file import RecordingFile, RunBooks, decoded
from glovecal_service.realtime.refusal import Refusal, Refused
from glovecal_service.realtime.sequence_order import SequenceOrder
from glovecal_service.store.recordings import LEAD_IN

WAITING_LIMIT = 65536
HELD_LIMIT = 1024
"""Frames with numbers that do not fit yet."""
REPAIR_AFTER_S = 0.5
"""A gap this old is asked for; a shorter one may still be on its way."""
ANSWER_WITHIN_S = 2.0
LEAD_IN_PATIENCE_S = 5.0
"""At the end of a recording; ten minutes at 120 Hz come in about as long."""
END_OF_RUN = (1 << 63) - 1


class LiveRecording:
    """Reads its glove's frames by a subscription of its own, which cannot hold up anybody else.

    The lead-in is fetched once a frame is there to lead to.
    """

    def __init__(
        self, session: zenoh.Session, keys: GloveKeys, file: RecordingFile, wish: LeadInWish
    ) -> None:
        self.file = file
        self.keys = keys
        self.refused = 0
        """Messages of a second publisher, damaged ones, and numbers that no glove can have reached."""
        self._session = session
        self._wish = wish
        self._lead_in: LeadIn | None = None
        self._run_id: int | None = None
        self._heard_ns = 0
        self._order = SequenceOrder()
        self._held: deque[tuple[Frame, bytes, bool]] = deque(maxlen=HELD_LIMIT)
        """Frames with their messages, and whether they were counted as refused."""
        self._repair_at = 0.0
        self._arrivals = Arrivals(session, keys.raw, limit=WAITING_LIMIT)

    def take_in(self) -> None:
        """Write what arrived since the last call."""
        for arrival in self._arrivals.drain():
            self._record(arrival.payload, arrival.received_ns)

    def take_lead_in(self) -> None:
        """Write what was fetched of the lead-in since the last call; never waits."""
        if self._lead_in is None:
            self._lead_in = self._begin_lead_in()
        else:
            self._write_some(self._lead_in)

    def _begin_lead_in(self) -> LeadIn | None:
        first, oldest = self.file.first_frame, self.file.oldest_frame
        if first is None or oldest is None or not self._wish.most_s:
            return None
        from_ns = first.monotonic_ns - round(self._wish.most_s * 1e9)
        return LeadIn(self._session, self.keys, oldest, from_ns)

    def _write_some(self, lead_in: LeadIn) -> None:
        frames = lead_in.take()
        if frames and not self.file.has_room_to_spare:
            lead_in.stop("the disk is nearly full")
            return
        for frame in frames:
            self.file.add(frame, encode_frame(frame))

    def _record(self, message: bytes, received_ns: int) -> None:
        frame = decoded(message)
        if frame is None:
            self.refused += 1
            return
        silent = received_ns - self._heard_ns > TAKEOVER_AFTER_NS
        if frame.run_id != self._run_id and self._run_id is not None and not silent:
            self.refused += 1
            return
        begins = frame.run_id != self._run_id
        self._run_id, self._heard_ns = frame.run_id, received_ns
        if begins:
            self._order.begin(frame.sequence, received_ns)
            self.file.add(frame, message, jumped=self.file.has_jumped(frame))
        else:
            self._record_in_order(frame, message, received_ns)

    def _record_in_order(self, frame: Frame, message: bytes, received_ns: int) -> None:
        """Record a frame that fits; hold one that does not until it is clear whether its publisher jumped."""
        jumps = self._order.jumps
        try:
            self._order.follow(frame.sequence, received_ns)
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
        for at, (each, bytes_of_it, _) in enumerate([*held, (frame, message, True)]):
            self.file.add(each, bytes_of_it, jumped=at == 0 and not self.file.lacks(each))

    def repair_now_and_then(self) -> None:
        """Twice a second at most, ask capture's log for what is missing."""
        now = time.monotonic()
        if now < self._repair_at:
            return
        self._repair_at = now + REPAIR_AFTER_S
        if not self.repair() and self._gaps():
            self._repair_at = now + 10 * REPAIR_AFTER_S

    def repair(self) -> int:
        """Fetch missing frames; how many came."""
        return sum(
            self._fetch(books, first, last)
            for books in list(self.file.runs.values())
            for first, last in books.missing()
        )

    def _fetch(self, books: RunBooks, first: int, last: int) -> int:
        try:
            frames = fetch_frames(
                self._session, self.keys.site, self.keys.glove, books.run_id, first, last,
                timeout_s=ANSWER_WITHIN_S,
            )  # fmt: skip
        except (NoAnswer, WireError):
            return 0
        return sum(self.file.add(frame, encode_frame(frame)) for frame in frames)

    def _gaps(self) -> bool:
        return any(books.missing() for books in self.file.runs.values())

    def finish(self, *, patience_s: float = 3.0) -> bool:
        """Stop: learn where capture is, wait for or fetch everything up to there, close the file.

        False if capture did not say how far it is: then the account ends with the last frame received.
        """
        known = bool(self.file.runs) and self._learn_the_end()
        self._arrivals.close()
        self.take_in()
        deadline = time.monotonic() + (patience_s if known else 0.0)
        while self._gaps() and (self.repair() or time.monotonic() < deadline):
            time.sleep(0.05)
        self._finish_lead_in()
        self.file.close()
        return known

    def _finish_lead_in(self) -> None:
        self.take_lead_in()
        deadline = time.monotonic() + LEAD_IN_PATIENCE_S
        while self._lead_in is not None and self._lead_in.goes_on and time.monotonic() < deadline:
            self._write_some(self._lead_in)
            time.sleep(0.01)
        if self._lead_in is not None:
            self._lead_in.stop()

    def abandon(self) -> None:
        """Close the file as it is; a later process resumes it."""
        self._arrivals.close()
        self.take_in()
        if self._lead_in is not None:
            self._lead_in.stop()
            self._lead_in.wait()
        self.file.close()

    def _learn_the_end(self) -> bool:
        try:
            status = ask_json(self._session, self.keys.status, timeout_s=1.0)
            run_id, sequence = int(status["run_id"], 16), int(status["sequence"])
        except (NoAnswer, KeyError, TypeError, ValueError):
            return False
        for ended in [books for books in self.file.runs.values() if books.run_id != run_id]:
            self._fetch(ended, ended.last + 1, END_OF_RUN)
        books = self.file.open_run(run_id)
        books.last = max(books.last, sequence)
        return True

    def _why_shorter(self) -> str:
        if self._lead_in is not None:
            return self._lead_in.why_shorter
        if self.file.first_frame is None:
            return "no frame has come yet"
        return "the recording was interrupted" if self.file.lead_in_s < self._wish.most_s - 1.0 else ""

    def account(self) -> dict[str, Any]:
        """Facts for the recording's row; over all runs ``sent`` = ``recorded`` + missing frames.

        The lead-in is counted apart, and nothing of it is ever missing.
        """
        runs = [books.document() for books in self.file.runs.values()]
        return {
            "first_sequence": runs[0]["first_sequence"] if runs else None,
            "last_sequence": runs[-1]["last_sequence"] if runs else None,
            "sent": sum(run["sent"] for run in runs),
            "recorded": sum(run["recorded"] for run in runs),
            "repaired": sum(run["repaired"] for run in runs),
            "missing": [gap for run in runs for gap in run["missing"]],
            "missing_frames": sum(last - first + 1 for run in runs for first, last in run["missing"]),
            "refused": self.refused,
            LEAD_IN: self._wish.account(len(self.file.lead_in), self.file.lead_in_s, self._why_shorter()),
            "runs": runs,
            "file": self.file.path.name,
        }
