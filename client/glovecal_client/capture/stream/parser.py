"""What a parser of a glove's byte stream takes and gives."""

from __future__ import annotations

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
