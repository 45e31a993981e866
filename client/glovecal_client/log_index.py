"""Finding frames of one run in its log by sequence number, while the log is still growing."""

from __future__ import annotations

import bisect
import threading
from pathlib import Path

from glovecal_client.log_records import Recording, scan_records
from glovecal_client.wire.frame import frame_sequence

_EVERY = 64
"""One entry for so many records: 8 hours at 120 Hz need less than 1 MB."""


class LogIndex:
    """A sparse index of a log whose frames have increasing sequence numbers. Safe for several threads."""

    def __init__(self, path: Path) -> None:
        self._recording = Recording.open(path)
        self._lock = threading.Lock()
        self._sequences: list[int] = []
        self._offsets: list[int] = []
        self._records = 0
        self._end = self._recording.first_record
        self.first: int | None = None
        """Lowest sequence number in the log, None while it is empty."""
        self.last: int | None = None
        """Highest sequence number in the log as of the last ``extend``."""

    def extend(self) -> None:
        """Take in the records written since the last call. Raises OSError."""
        with self._lock, self._recording.path.open("rb") as file:
            start = self._end
            for end, payload in scan_records(file, self._end):
                self._add(frame_sequence(payload), start)
                start = self._end = end

    def _add(self, sequence: int, offset: int) -> None:
        if self._records % _EVERY == 0:
            self._sequences.append(sequence)
            self._offsets.append(offset)
        self._records += 1
        self.last = sequence
        if self.first is None:
            self.first = sequence

    def payloads(self, first: int, last: int, *, max_count: int, max_bytes: int) -> list[bytes]:
        """Frames with sequence ``first`` to ``last``, both included, up to the bounds, in order."""
        self.extend()
        with self._lock:
            entry = bisect.bisect_right(self._sequences, first) - 1
            offset = self._offsets[entry] if entry >= 0 else self._recording.first_record
        found: list[bytes] = []
        total = 0
        with self._recording.path.open("rb") as file:
            for _, payload in scan_records(file, offset):
                sequence = frame_sequence(payload)
                total += len(payload) if sequence >= first else 0
                if sequence > last or len(found) >= max_count or total > max_bytes:
                    break
                if sequence >= first:
                    found.append(payload)
        return found
