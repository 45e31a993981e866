"""Files of a CyberGlove III's memory card: records found by their time, all else kept or counted."""

from __future__ import annotations

import csv
import random
from pathlib import Path

import pytest
from glove_logs import LAYOUT_22
from glove_logs import records_of as streamed

from glovecal_client.capture.cyberglove3.card import card_to_table, read_card
from glovecal_client.errors import BadOption
from glovecal_service.emulators.cyberglove3 import EmulatedCyberGlove3, card_file, card_header

HEADER = card_header("subject anna, monday")
SENSORS = LAYOUT_22


def test_a_whole_file() -> None:
    records = [record for record, _ in streamed("cyberglove3")]
    recording = read_card(card_file("subject anna, monday", records), SENSORS)
    assert recording.header == HEADER
    assert len(recording.records) == len(records)
    assert (recording.damaged, recording.skipped_bytes) == (0, 0)
    assert recording.trailer == b"00 " + bytes(64)
    times = recording.times_s(30, 3)
    assert times[:4] == pytest.approx([0, 1 / 90, 2 / 90, 3 / 90], abs=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_incomplete_records_are_counted_and_left_out(seed: int) -> None:
    chance = random.Random(seed)
    records = streamed("cyberglove3")
    cut = {number for number in range(1, len(records) - 1) if chance.random() < 0.2}
    parts = [
        record[: chance.randrange(14, 60)] if number in cut else record
        for number, (record, _) in enumerate(records)
    ]
    recording = read_card(card_file("x", parts), SENSORS)
    assert recording.damaged == len(cut)
    assert len(recording.records) == len(records) - len(cut)
    assert recording.skipped_bytes == sum(len(parts[number]) for number in cut)


def test_what_the_glove_wrote_itself_while_it_streamed() -> None:
    glove = EmulatedCyberGlove3()
    assert glove.feed(b"1Amonday\x01", 0.0).endswith(b"\0")
    assert glove.feed(b"subject anna\x01", 0.0) == b"\0"
    glove.feed(b"1es1m\x03", 0.0)
    glove.feed(b"1S", 1.0)
    glove.due(3.0)
    glove.feed(b"\x03", 3.0)
    assert b"monday" in glove.feed(b"?l", 3.1)
    recording = read_card(glove.feed(b"1D", 3.2)[2:], SENSORS)
    assert recording.header.startswith(b"subject anna\n")
    assert len(recording.records) == len(glove.sent) == 180


def test_midnight_passes() -> None:
    glove = EmulatedCyberGlove3(clock_s=86399.0)
    glove.feed(b"1m\x03", 0.0)
    records = [glove.record(number / 90) for number in range(180)]
    times = read_card(card_file("x", records), SENSORS).times_s(30, 3)
    assert times[-1] == pytest.approx(179 / 90, abs=0.012)
    assert times == sorted(times)


def test_a_table_for_take_import(tmp_path: Path) -> None:
    records = streamed("cyberglove3")
    card, table = tmp_path / "MONDAY", tmp_path / "monday.csv"
    card.write_bytes(card_file("x", [record for record, _ in records]))
    recording = card_to_table(card, table, layout="cyberglove3-22", frame_rate=30, multiplier=3)
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(recording.records) == len(records)
    assert [float(rows[5][f"s.{name}"]) for name in SENSORS] == list(records[5][1])
    with pytest.raises(BadOption, match="exists already"):
        card_to_table(card, table, layout="cyberglove3-22", frame_rate=30, multiplier=3)
    empty = tmp_path / "EMPTY"
    empty.write_bytes(b"nothing here\n" + bytes(28))
    with pytest.raises(BadOption, match="has no record of a CyberGlove III in 41 bytes"):
        card_to_table(empty, tmp_path / "e.csv", layout="cyberglove3-22", frame_rate=30, multiplier=3)
