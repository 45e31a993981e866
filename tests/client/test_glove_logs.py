"""Every driver's parser against byte logs, whole and damaged, and against random bytes."""

from __future__ import annotations

import random
from collections.abc import Iterable
from itertools import pairwise

import pytest
from glove_logs import CASES, INSIDE_VALUES, WHOLE_RECORDS, Values, in_pieces, records_of
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_client.capture.cyberglove.record import RecordFormat, RecordReader
from glovecal_client.capture.stream.parser import StreamParser

SEEDS = range(3)
MEGABYTE = 1_000_000
PROTOCOLS = pytest.mark.parametrize("name", CASES)


def read(parser: StreamParser, pieces: Iterable[bytes]) -> list[Values]:
    return [sample.values for piece in pieces for sample in parser.feed(piece)]


def is_subsequence(found: list[Values], sent: list[Values]) -> bool:
    waiting = iter(sent)
    return all(any(values == other for other in waiting) for values in found)


@PROTOCOLS
@pytest.mark.parametrize("seed", SEEDS)
def test_every_record_of_a_whole_log_is_read(name: str, seed: int) -> None:
    device, records = CASES[name].device(), records_of(name)
    data = b"".join(record for record, _ in records)
    found = read(device.new_parser(), in_pieces(data, random.Random(seed)))
    left_out = 1 if CASES[name].lines else 0  # the first line may have lost its beginning
    assert found == [values for _, values in records[left_out:]]
    assert device.counters.bad_frames == 0


@PROTOCOLS
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("damage", WHOLE_RECORDS, ids=lambda damage: damage.__name__)
def test_a_damaged_log_gives_nothing_that_was_not_sent(name: str, damage, seed: int) -> None:
    chance, device, records = random.Random(seed), CASES[name].device(), records_of(name)
    hit = {number for number in range(2, len(records) - 4) if chance.random() < 0.25}
    log = b"".join(
        damage(record, chance) if number in hit else record for number, (record, _) in enumerate(records)
    )
    found = read(device.new_parser(), in_pieces(log, chance))
    sent = [values for _, values in records]
    assert is_subsequence(found, sent)
    assert len(found) >= len(records) - 1 - 2 * len(hit), "at most the damaged record and the one after it"
    assert found[-1] == sent[-1]


@PROTOCOLS
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("damage", INSIDE_VALUES, ids=lambda damage: damage.__name__)
def test_damage_inside_a_value_costs_two_records_at_most(name: str, damage, seed: int) -> None:
    """With a checksum nothing wrong comes out. Without one a lost digit leaves another number, in range."""
    chance, device, records = random.Random(100 + seed), CASES[name].device(), records_of(name)
    hit = set(range(3, len(records) - 3, 7))
    log = b"".join(
        damage(record, chance) if number in hit else record for number, (record, _) in enumerate(records)
    )
    found = read(device.new_parser(), in_pieces(log, chance))
    sent = [values for _, values in records]
    whole = [values for number, values in enumerate(sent) if number not in hit and number - 1 not in hit]
    assert is_subsequence(whole[1:], found)
    wrong = [values for values in found if values not in sent]
    assert device.counts is not None
    assert all(device.counts[0] <= value <= device.counts[1] for values in wrong for value in values)
    assert len(wrong) == 0 if CASES[name].checksum else len(wrong) <= len(hit)


@PROTOCOLS
def test_a_megabyte_of_random_bytes_gives_no_frame_and_the_next_good_one_is_found(name: str) -> None:
    assert false_frames(name, MEGABYTE, seed=7) <= (0 if CASES[name].checksum else 1)


@pytest.mark.slow
@PROTOCOLS
@pytest.mark.parametrize("seed", SEEDS)
def test_ten_megabytes_of_random_bytes(name: str, seed: int) -> None:
    assert false_frames(name, 10 * MEGABYTE, seed) <= (0 if CASES[name].checksum else 10)


def false_frames(name: str, size: int, seed: int) -> int:
    """Frames in ``size`` random bytes; fails unless one of the next two good records is read."""
    chance, parser = random.Random(seed), CASES[name].device().new_parser()
    false = sum(len(parser.feed(chance.randbytes(4096))) for _ in range(size // 4096 + 1))
    records = records_of(name)
    good = read(parser, [records[0][0], records[1][0]])
    assert good
    assert all(values in (records[0][1], records[1][1]) for values in good)
    return false


def test_a_megabyte_of_random_bytes_gives_no_frame_of_a_cyberglove() -> None:
    chance, reader = random.Random(7), RecordReader(RecordFormat(18))
    assert sum(len(reader.feed(chance.randbytes(4096))) for _ in range(MEGABYTE // 4096)) <= 1
    good = b"S" + bytes(range(1, 19)) + b"\x83\0"
    assert reader.feed(3 * good)


@PROTOCOLS
@settings(max_examples=40)
@given(wild=st.lists(st.binary(max_size=200), max_size=12))
def test_wild_bytes_raise_nothing_and_the_next_good_record_is_found(name: str, wild: list[bytes]) -> None:
    device, records = CASES[name].device(), records_of(name)
    parser = device.new_parser()
    for piece in wild:
        parser.feed(piece)
    found = read(parser, [record for record, _ in records[:3]])
    assert found[-1] == records[2][1]


@PROTOCOLS
@settings(max_examples=25)
@given(data=st.data())
def test_pieces_do_not_matter(name: str, data: st.DataObject) -> None:
    records = records_of(name)[:8]
    log = b"\xff\n".join(record for record, _ in records)
    cuts = sorted(data.draw(st.sets(st.integers(0, len(log)), max_size=20)) | {0, len(log)})
    pieces = [log[begin:end] for begin, end in pairwise(cuts)]
    assert read(CASES[name].device().new_parser(), pieces) == read(CASES[name].device().new_parser(), [log])
