"""How often random or damaged bytes become a frame: the table of docs/gloves.md (seconds).

.venv/bin/python tests/client/measure_damage.py
"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from glove_logs import CASES, Values, flipped_bit, line_device, lost_byte, records_of

from glovecal_client.capture.cyberglove.record import Record, RecordFormat, RecordReader
from glovecal_client.capture.stream.parser import Sample
from glovecal_service.emulators.cyberglove import EmulatedBox

RANDOM_BYTES, CHUNK, DAMAGED = 10_000_000, 4096, 6000
Damage = Callable[[bytes, random.Random], bytes]


def values_of(found: Sample | Record) -> Values:
    return tuple(found.values)


def wrong_share(parser: Any, records: list[tuple[bytes, Values]], damage: Damage) -> float:
    """Wrong readings for each damaged record, two whole ones behind each."""
    chance, sent = random.Random(11), {values for _, values in records}
    parser.feed(records[0][0])
    wrong = 0
    for number in range(DAMAGED):
        record, _ = records[number % len(records)]
        wrong += sum(
            values_of(one) not in sent for one in parser.feed(damage(record, chance) + record + record)
        )
    return wrong / DAMAGED


def in_random_bytes(parser: Any, size: int = RANDOM_BYTES) -> int:
    chance = random.Random(11)
    return sum(len(parser.feed(chance.randbytes(CHUNK))) for _ in range(size // CHUNK + 1))


def cyberglove_records() -> list[tuple[bytes, Values]]:
    box = EmulatedBox(18)
    box.feed(b"U\x01", 0.0)
    records = [box.record("S", number / 100) for number in range(60)]
    return [(record, tuple(record[1:19])) for record in records]


def main() -> None:
    form = RecordFormat(18)
    protocols: dict[str, tuple[Callable[[], Any], list[tuple[bytes, Values]]]] = {
        "cyberglove": (lambda: RecordReader(form), cyberglove_records())
    }
    for name, case in CASES.items():
        protocols[name] = ((lambda case=case: case.device().new_parser()), records_of(name))
    for name, (parser, records) in protocols.items():
        shares = [
            f"{100 * wrong_share(parser(), records, damage):.1f} %" for damage in (lost_byte, flipped_bit)
        ]
        print(name, in_random_bytes(parser()), *shares, sep="\t")
    for columns in (1, 2):
        names = ", ".join(f'"C{number}"' for number in range(columns))
        with tempfile.TemporaryDirectory() as folder:
            device = line_device(Path(folder), f"[line]\ncolumns = [{names}]\n")
        found = in_random_bytes(device.new_parser(), 2 * RANDOM_BYTES)
        print(f"line, {columns} columns, no checksum, twice as many bytes", found, sep="\t")


if __name__ == "__main__":
    main()
