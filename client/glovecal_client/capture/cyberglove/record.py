"""Sample records of a CyberGlove I/II, found in a stream of bytes that may be damaged.

A record is ``S``, one byte per sensor (never 0), five bytes of time stamp if switched on, a status byte if
switched on, error pairs (``es`` too fast, ``eg`` glove not plugged in), NUL. There is no checksum, and ``S``
is also a legal sensor value; so a place in the stream is trusted only when head, status bit and NUL sit at
the right distance in two records running, and from then on as long as every record fits.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

STREAM_HEAD = ord("S")
TICKS_PER_SECOND = 115200
"""Of a record's time stamp, which wraps at 2^32."""
_ERROR_LETTERS = b"sg"
_ALWAYS_SET = 0x80
_PLUGGED = 0x01


@dataclass(frozen=True)
class RecordFormat:
    """What a record holds. ``sensors`` is the number of values sent."""

    sensors: int
    timestamp: bool = False
    status: bool = True

    @property
    def body(self) -> int:
        """Bytes from the head to just before the error pairs or the NUL."""
        return 1 + self.sensors + 5 * self.timestamp + self.status

    @property
    def length(self) -> int:
        """Bytes of a whole record without error pairs: 20 and 24 for a bare one of 18 and 22 sensors."""
        return self.body + 1


@dataclass(frozen=True)
class Record:
    """One sound record: sensor bytes in hardware order, and what else was switched on."""

    values: bytes
    ticks: int | None
    """Time stamp in 1/115200 s, wrapping at 2^32; None when switched off."""
    status: int | None

    @property
    def button(self) -> bool:
        """The wrist switch: status bit 1."""
        return bool(self.status is not None and self.status & 2)


@dataclass(frozen=True)
class _Found:
    length: int
    errors: tuple[str, ...] = ()


_UNDECIDED = _Found(0)
"""Bytes are missing to tell whether a record begins here."""


def decode_ticks(stamp: bytes) -> int:
    """The number in five bytes: a flag byte ``1xxxDCBA``, then four bytes, least significant first.

    A data byte that is really 0 travels as a stand-in with its flag set. The leading 1 is not asked for: one
    driver's author saw it missing on real hardware.
    """
    data = bytes(0 if stamp[0] >> index & 1 else stamp[1 + index] for index in range(4))
    return int.from_bytes(data, "little")


class RecordReader:
    """Feed it bytes as they come; it returns the sound records and counts the rest.

    ``bad_frames`` counts records with a zero sensor byte or an error pair, and each loss of the rhythm once;
    ``resyncs`` the losses of rhythm; ``skipped_bytes`` what belonged to no record; ``errors`` why records
    were bad (``zero``, ``s``, ``g``, ``damaged``).
    """

    def __init__(self, record_format: RecordFormat) -> None:
        self.format = record_format
        self.bad_frames: int = 0
        self.resyncs: int = 0
        self.skipped_bytes: int = 0
        self.errors: Counter[str] = Counter()
        self._buffer = bytearray()
        self._in_step = False
        self._last_used = 0
        """The byte before the buffer; a stream's first record counts as standing behind a NUL."""

    def feed(self, data: bytes) -> list[Record]:
        """The sound records completed by ``data``, oldest first."""
        self._buffer += data
        records: list[Record] = []
        at = 0
        while (end := self._step(at, records)) != at:
            at = end
        self._last_used = self._byte_before(at)
        del self._buffer[:at]
        return records

    def _step(self, at: int, records: list[Record]) -> int:
        """Read or skip something at ``at``; returns where to go on, ``at`` itself when bytes are missing."""
        if not self._in_step:
            head = self._buffer.find(STREAM_HEAD, at)
            if head != at:
                head = len(self._buffer) if head < 0 else head
                self.skipped_bytes += head - at
                return head
        found = self._match(at)
        if found is _UNDECIDED:
            return at
        if found is None or (self._in_step and self._strange_byte_at(at + found.length)):
            return self._stumble(at)
        if not self._in_step:
            following = self._match(at + found.length)
            if following is _UNDECIDED:
                return at
            if following is None:
                self.skipped_bytes += 1
                return at + 1
            self._in_step = True
            if self._byte_before(at) != 0:
                # A stray head shortly before the end of a damaged record fits too: only a witness then.
                self.skipped_bytes += found.length
                return at + found.length
        self._take(at, found, records)
        return at + found.length

    def _stumble(self, at: int) -> int:
        if self._in_step:
            self._in_step = False
            self.resyncs += 1
            self.bad_frames += 1
            self.errors["damaged"] += 1
            return self._step_over(at)
        self.skipped_bytes += 1
        return at + 1

    def _byte_before(self, at: int) -> int:
        return self._buffer[at - 1] if at > 0 else self._last_used

    def _strange_byte_at(self, at: int) -> bool:
        """Whether a byte that begins no record stands there already.

        Asking for the next head where it has come already costs the record before a disturbance, and keeps
        out most of those that pushed-in bytes make up.
        """
        return at < len(self._buffer) and self._buffer[at] != STREAM_HEAD

    def _step_over(self, at: int) -> int:
        """After a loss of rhythm look for the next head, this byte included only if it is none."""
        if at < len(self._buffer) and self._buffer[at] == STREAM_HEAD:
            self.skipped_bytes += 1
            return at + 1
        head = self._buffer.find(STREAM_HEAD, at)
        head = len(self._buffer) if head < 0 else head
        self.skipped_bytes += head - at
        return head

    def _match(self, at: int) -> _Found | None:
        """The record that begins at ``at``, None if there is none."""
        buffer, body = self._buffer, self.format.body
        if at >= len(buffer):
            return _UNDECIDED
        if buffer[at] != STREAM_HEAD:
            return None
        end = at + body
        if end >= len(buffer):
            return _UNDECIDED
        if self.format.status and not buffer[end - 1] & _ALWAYS_SET:
            return None
        errors: list[str] = []
        while buffer[end] != 0:
            if buffer[end] != ord("e") or len(errors) == len(_ERROR_LETTERS):
                return None
            if end + 2 >= len(buffer):
                return _UNDECIDED
            if buffer[end + 1] not in _ERROR_LETTERS:
                return None
            errors.append(chr(buffer[end + 1]))
            end += 2
        return _Found(end + 1 - at, tuple(errors))

    def _take(self, at: int, found: _Found, records: list[Record]) -> None:
        form = self.format
        values = bytes(self._buffer[at + 1 : at + 1 + form.sensors])
        status = self._buffer[at + form.body - 1] if form.status else None
        errors = found.errors or (("zero",) if 0 in values else ())
        if status is not None and not status & _PLUGGED:
            errors = errors or ("g",)
        if errors:
            self.bad_frames += 1
            self.errors.update(errors)
            return
        after = at + 1 + form.sensors
        ticks = decode_ticks(bytes(self._buffer[after : after + 5])) if form.timestamp else None
        records.append(Record(values, ticks, status))
