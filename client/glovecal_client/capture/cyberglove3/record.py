"""The 61-byte record of a CyberGlove III, streamed or on its memory card.

``HH:MM:SS:FF:nS`` in ASCII, 22 words of 16 bits, high byte first, then CR LF NUL. A word holds 12 bits; 0
is not a reading. There is no checksum: a record counts when its time, all words and its end fit. Sources:
five public readers and the vendor's manual, as collected in the project's fact sheet. They disagree
whether FF begins at 0 or 1, so 0 to 30 is read.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

from glovecal_client.capture.stream.parser import Counters

LENGTH = 61
LARGEST = 0x0FFF
_TIME = re.compile(rb"([01][0-9]|2[0-3]):([0-5][0-9]):([0-5][0-9]):([0-2][0-9]|30):([0-9])S")
_TIME_LENGTH = 14
_WORDS = struct.Struct(">22H")
_END = b"\r\n\0"


@dataclass(frozen=True, slots=True)
class TimedRecord:
    """The words of one record in hardware order, and when the glove's clock says they were taken."""

    words: tuple[int, ...]
    second_of_day: int
    frame: int
    sub_sample: int


class TimedRecordReader:
    """Finds records by their time pattern, which is looked for anew after every damaged one.

    ``used`` names the words that must hold a reading: an 18-sensor glove has four that do not.
    """

    def __init__(self, counters: Counters, used: tuple[int, ...]) -> None:
        self._counters = counters
        self._used = used
        self._buffer = bytearray()
        self._before = 0
        """Bytes fed and let go of."""
        self.span: tuple[int, int] | None = None
        """Where the first sound record began and the last one ended, in bytes fed."""

    def feed(self, data: bytes) -> list[TimedRecord]:
        """The sound records completed by ``data``, oldest first."""
        self._buffer += data
        records: list[TimedRecord] = []
        at = 0
        while (begins := _TIME.search(self._buffer, at)) is not None:
            self._counters.skipped_bytes += begins.start() - at
            at = begins.start()
            if at + LENGTH <= len(self._buffer) and (record := self._record(at, begins)) is not None:
                records.append(record)
                first = self._before + at if self.span is None else self.span[0]
                at += LENGTH
                self.span = first, self._before + at
                continue
            following = _TIME.search(self._buffer, at + _TIME_LENGTH)
            if following is None and at + LENGTH > len(self._buffer):
                break  # it may still become whole
            self._counters.bad_frames += 1
            after = at + _TIME_LENGTH if following is None else following.start()
            self._counters.skipped_bytes += after - at
            at = after
        else:
            kept = max(at, len(self._buffer) - _TIME_LENGTH + 1)
            self._counters.skipped_bytes += kept - at
            at = kept
        del self._buffer[:at]
        self._before += at
        return records

    def _record(self, at: int, begins: re.Match[bytes]) -> TimedRecord | None:
        if self._buffer[at + LENGTH - len(_END) : at + LENGTH] != _END:
            return None
        words = _WORDS.unpack_from(self._buffer, at + _TIME_LENGTH)
        if max(words) > LARGEST or not all(words[place] for place in self._used):
            return None
        hour, minute, second, frame, sub_sample = (int(part) for part in begins.groups())
        return TimedRecord(words, 3600 * hour + 60 * minute + second, frame, sub_sample)
