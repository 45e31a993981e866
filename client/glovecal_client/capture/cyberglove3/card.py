"""Recordings on the memory card of a CyberGlove III.

Public is what one laboratory's scripts do: header text, a line feed, 28 bytes nobody describes, the
records of the stream, some of them incomplete, and a trailer. So everything before the first record and
after the last is kept as it is and not interpreted, and records are found by their time pattern.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from glovecal_client.capture.cyberglove3.device import LAYOUTS, word_places
from glovecal_client.capture.cyberglove3.record import LENGTH, TimedRecord, TimedRecordReader
from glovecal_client.capture.stream.parser import Counters
from glovecal_client.errors import BadOption

_HALF_A_DAY_S = 43200.0
_DAY_S = 86400.0


@dataclass(frozen=True)
class CardRecording:
    """What a file of the card holds."""

    header: bytes
    """Everything before the first sound record."""
    records: tuple[TimedRecord, ...]
    damaged: int
    """Records that began and were cut short, out of range, or ended wrongly."""
    skipped_bytes: int
    """Bytes between records that belong to none."""
    trailer: bytes

    def times_s(self, frame_rate: float, multiplier: int) -> list[float]:
        """Seconds since the first record by the glove's clock, going on over midnight."""
        times: list[float] = []
        days = 0
        for record in self.records:
            ticks = record.frame + record.sub_sample / multiplier
            time_s = record.second_of_day + ticks / frame_rate + _DAY_S * days
            if times and times[-1] - time_s > _HALF_A_DAY_S:
                days += 1
                time_s += _DAY_S
            times.append(time_s)
        return [time_s - times[0] for time_s in times]


def read_card(data: bytes, sensors: tuple[str, ...]) -> CardRecording:
    """The records of ``sensors`` in a file; one without any has it all as its header."""
    counters = Counters()
    reader = TimedRecordReader(counters, word_places(sensors))
    records = tuple(reader.feed(data))
    first, end = reader.span or (len(data), len(data))
    between = end - first - LENGTH * len(records)
    return CardRecording(data[:first], records, counters.bad_frames, between, data[end:])


def card_layout(data: bytes) -> str | None:
    """The layout whose records a file, or its beginning, holds; None for one that is of no card."""
    records = {layout: len(read_card(data, sensors).records) for layout, sensors in LAYOUTS.items()}
    best = max(records, key=lambda layout: (records[layout], len(LAYOUTS[layout])))
    return best if records[best] else None


def card_to_table(
    source: Path, target: Path, *, layout: str, frame_rate: float, multiplier: int
) -> CardRecording:
    """Write the sound records of a card's file as a take table (``time_s``, ``s.<SENSOR>``).

    Raises BadOption for a layout that is none of the glove's, a file without a record, or one that is there.
    """
    if layout not in LAYOUTS:
        raise BadOption(f"layout {layout!r} must be one of {', '.join(LAYOUTS)}")
    sensors = LAYOUTS[layout]
    recording = read_card(source.read_bytes(), sensors)
    if not recording.records:
        raise BadOption(f"{source} has no record of a CyberGlove III in {len(recording.header)} bytes")
    if target.exists():
        raise BadOption(f"{target} exists already; name a new file")
    places = word_places(sensors)
    with target.open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["time_s", *(f"s.{name}" for name in sensors)])
        last_s = -1.0
        for time_s, record in zip(recording.times_s(frame_rate, multiplier), recording.records, strict=True):
            if time_s <= last_s:
                continue  # a take's times grow; a record with a repeated time says nothing new
            table.writerow([f"{time_s:.6f}", *(record.words[place] for place in places)])
            last_s = time_s
    return recording
