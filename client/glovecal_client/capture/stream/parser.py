"""What a parser of a glove's byte stream takes and gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Sample:
    """One sound record, values as the glove sent them."""

    values: tuple[float, ...]
    """In the order of the device's sensors."""
    ticks: int | None = None
    """The glove's own time stamp in ticks of its clock, None if it sent none."""
    context: tuple[float, ...] = ()
    """In the order of the device's context; NaN where not measured."""
    button: bool = False


@dataclass(slots=True)
class Counters:
    """What went wrong in a stream, over all openings of the device."""

    bad_frames: int = 0
    """Records thrown away: damaged, out of range or with a wrong checksum; each loss of rhythm once."""
    skipped_bytes: int = 0
    """Bytes that belonged to no record."""


class StreamParser(Protocol):
    """Finds records in bytes that come in pieces of any length and may be damaged. It never raises."""

    def feed(self, data: bytes) -> list[Sample]:
        """The sound records completed by ``data``, oldest first; the rest is counted."""
        ...
