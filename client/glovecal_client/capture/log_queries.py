"""Answers to gap-repair queries, ``?run=HEX16;from=A;to=B``, from the capture logs."""

from __future__ import annotations

import re
import struct
import threading

from glovecal_client.capture.log_folder import LogFolder
from glovecal_client.errors import BadName
from glovecal_client.log_index import LogIndex

MAX_REPLY_FRAMES = 4096
MAX_REPLY_BYTES = 4 << 20
_QUESTION = re.compile(r"run=([0-9a-f]{16});from=([0-9]{1,20});to=([0-9]{1,20})\Z")
_LENGTH = struct.Struct("<I")


class LogQueries:
    """Looks frames up in the logs of one glove, those of the running and of earlier runs."""

    def __init__(self, folder: LogFolder) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._indexes: dict[int, LogIndex] = {}

    def index(self, run_id: int) -> LogIndex:
        """The index of a run's log. Raises BadName for a run that was not recorded here."""
        with self._lock:
            if run_id not in self._indexes:
                path = self._folder.find(run_id)
                if path is None:
                    raise BadName(f"run {run_id:016x} was not recorded here")
                self._indexes[run_id] = LogIndex(path)
            return self._indexes[run_id]

    def answer(self, parameters: str) -> bytes:
        """The reply's payload: each frame as u32 length and bytes. Raises BadName, WireError, DamagedLog."""
        asked = _QUESTION.match(parameters)
        if not asked:
            raise BadName(f"log query {parameters[:80]!r} is not run=HEX16;from=A;to=B")
        first, last = int(asked[2]), int(asked[3])
        if first > last:
            raise BadName(f"log query: from={first} is after to={last}")
        found = self.index(int(asked[1], 16)).payloads(
            first, last, max_count=MAX_REPLY_FRAMES, max_bytes=MAX_REPLY_BYTES
        )
        return b"".join(_LENGTH.pack(len(payload)) + payload for payload in found)
