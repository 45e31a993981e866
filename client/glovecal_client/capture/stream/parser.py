"""What a parser of a glove's byte stream takes and gives; text lines in a stream that may be damaged."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

_SHOWN = 120


@dataclass(frozen=True, slots=True)
class Sample:
    """One sound record, values as the glove sent them."""

    values: tuple[float, ...]
    """In the order of the device's sensors."""
    ticks: float | None = None
    """The glove's own time stamp in ticks of its clock, with fractions if it sends them; None without one."""
    context: tuple[float, ...] = ()
    """In the order of the device's context; NaN where not measured."""
    button: bool = False


class BadRecord(Exception):
    """A record that is no sample; its text says why: the field, its value and what it may be."""


@dataclass(slots=True)
class Counters:
    """What went wrong in a stream, over all openings of the device."""

    bad_frames: int = 0
    """Records thrown away: damaged, out of range or with a wrong checksum; each loss of rhythm once."""
    skipped_bytes: int = 0
    """Bytes that belonged to no record."""
    last_refused: str = ""
    """The last record thrown away, as it came, and why; empty before the first, and from parsers that cannot
    tell."""

    def refuse(self, record: bytes, why: str) -> None:
        """Count a record that is no sample."""
        self.bad_frames += 1
        self.last_refused = f"{shown(record)}: {why}"


def shown(record: bytes) -> str:
    """A record's bytes as a person may read them, its end left out where it is long."""
    text = record[:_SHOWN].decode("ascii", "backslashreplace")
    return repr(text) + (f" and {len(record) - _SHOWN} bytes more" if len(record) > _SHOWN else "")


class StreamParser(Protocol):
    """Finds records in bytes that come in pieces of any length and may be damaged. It never raises."""

    def feed(self, data: bytes) -> list[Sample]:
        """The sound records completed by ``data``, oldest first; the rest is counted."""
        ...


class LineReader:
    """Cuts a stream into lines and has each parsed; a line that raises BadRecord is counted and kept to show.

    ``parse`` gives None for a line that is a part of a sample and not its last. ``end``: the byte that ends a
    line; a carriage return before a line feed is nothing. The first line may have lost its beginning, which
    cannot be told from the line itself, so it is left out. Empty lines are nothing; a line longer than
    ``longest`` bytes is bad, and no more of it is kept.
    """

    def __init__(
        self,
        parse: Callable[[bytes], Sample | None],
        counters: Counters,
        *,
        longest: int = 512,
        end: bytes = b"\n",
    ) -> None:
        self._parse = parse
        self._counters = counters
        self._longest = longest
        self._end = end
        self._rest = b""
        self._leaving_out = True
        """Until the next end of a line: the cut first line, or the rest of one that is too long."""

    def feed(self, data: bytes) -> list[Sample]:
        """The samples of the lines completed by ``data``."""
        *lines, rest = (self._rest + data).split(self._end)
        samples = []
        for line in lines:
            if self._leaving_out:
                self._leaving_out = False
                self._counters.skipped_bytes += len(line) + 1
            elif text := line.strip(b"\r "):
                try:
                    if (sample := self._sample(text)) is not None:
                        samples.append(sample)
                except BadRecord as bad:
                    self._counters.refuse(text, str(bad))
                    self._counters.skipped_bytes += len(line) + 1
        if len(rest) > self._longest:
            if not self._leaving_out:
                self._counters.refuse(rest, self._too_long())
            self._counters.skipped_bytes += len(rest)
            self._leaving_out, rest = True, b""
        self._rest = rest
        return samples

    def _sample(self, text: bytes) -> Sample | None:
        if len(text) > self._longest:
            raise BadRecord(self._too_long())
        return self._parse(text)

    def _too_long(self) -> str:
        hint = " (each ends with a carriage return alone?)" if self._end == b"\n" else ""
        return f"no line is longer than {self._longest} bytes{hint}"


_DIGITS = re.compile(rb"0|[1-9][0-9]{0,18}")


def whole_number(text: bytes, most: int | None, name: str) -> int:
    """The number from 0 to ``most`` written as digits without leading zeros. Raises BadRecord with ``name``.

    A microcontroller prints no leading zeros; a line that was pieced together often has one. ``most`` None:
    whatever 64 bits hold.
    """
    if not _DIGITS.fullmatch(text):
        raise BadRecord(f"{name} is {text.decode('ascii', 'backslashreplace')!r}, not a whole number")
    number = int(text)
    if most is not None and number > most:
        raise BadRecord(f"{name} is {number}, above {most}")
    return number
