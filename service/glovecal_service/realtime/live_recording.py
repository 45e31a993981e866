"""One recording while it goes on: frames in, gaps repaired, and at its end the exact account."""

from __future__ import annotations

import time
from typing import Any

import zenoh

from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.gap_repair import fetch_frames
from glovecal_client.keys import GloveKeys
from glovecal_client.queries import ask_json
from glovecal_client.wire.frame import encode_frame
from glovecal_service.realtime.arrivals import Arrivals
from glovecal_service.realtime.frame_gate import TAKEOVER_AFTER_NS
from glovecal_service.realtime.recording_file import RecordingFile, RunBooks, decoded

WAITING_LIMIT = 65536
REPAIR_AFTER_S = 0.5
"""A gap this old is asked for; a shorter one may still be on its way."""
ANSWER_WITHIN_S = 2.0
END_OF_RUN = (1 << 63) - 1


class LiveRecording:
    """Reads its glove's frames by a subscription of its own, which cannot hold up anybody else."""

    def __init__(self, session: zenoh.Session, keys: GloveKeys, file: RecordingFile) -> None:
        self.file = file
        self.keys = keys
        self.refused = 0
        """Messages of a second publisher, and damaged ones."""
        self._session = session
        self._run_id: int | None = None
        self._heard_ns = 0
        self._repair_at = 0.0
        self._arrivals = Arrivals(session, keys.raw, limit=WAITING_LIMIT)

    def take_in(self) -> None:
        """Write what arrived since the last call."""
        for arrival in self._arrivals.drain():
            self._record(arrival.payload, arrival.received_ns)

    def _record(self, message: bytes, received_ns: int) -> None:
        frame = decoded(message)
        if frame is None:
            self.refused += 1
            return
        silent = received_ns - self._heard_ns > TAKEOVER_AFTER_NS
        if frame.run_id != self._run_id and self._run_id is not None and not silent:
            self.refused += 1
            return
        self._run_id, self._heard_ns = frame.run_id, received_ns
        self.file.add(frame, message)

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
        self.file.close()
        return known

    def abandon(self) -> None:
        """Close the file as it is; a later process resumes it."""
        self._arrivals.close()
        self.take_in()
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

    def account(self) -> dict[str, Any]:
        """Facts for the recording's row; over all runs ``sent`` = ``recorded`` + missing frames."""
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
            "runs": runs,
            "file": self.file.path.name,
        }
