"""Ranges of recorded sequence numbers against plain sets, and a file's account of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glovecal_client.wire.frame import Frame, FrameFlag, encode_frame
from glovecal_service.recorder.run_books import SequenceRanges
from glovecal_service.recorder.run_ledger import RunLedger

numbers = st.lists(st.integers(0, 60), max_size=80)


@given(numbers)
def test_it_is_a_set(added: list[int]) -> None:
    ranges, plain = SequenceRanges(), set()
    for number in added:
        assert ranges.add(number) == (number not in plain)
        plain.add(number)
    assert len(ranges) == len(plain)
    assert [number for number in range(-1, 63) if number in ranges] == sorted(plain)
    assert (ranges.first, ranges.last) == ((min(plain), max(plain)) if plain else (None, None))


@given(numbers, st.integers(0, 60), st.integers(0, 60))
def test_missing_is_the_complement(added: list[int], first: int, last: int) -> None:
    ranges = SequenceRanges(added)
    missing = [number for low, high in ranges.missing(first, last) for number in range(low, high + 1)]
    assert missing == [number for number in range(first, last + 1) if number not in set(added)]


def test_ranges_without_a_gap_are_one() -> None:
    ranges = SequenceRanges([5, 3, 4, 9, 8])
    assert list(ranges) == [(3, 5), (8, 9)]
    ranges.add(7)
    ranges.add(6)
    assert list(ranges) == [(3, 9)]


def test_a_file_opened_again_knows_where_the_numbers_jumped(tmp_path: Path) -> None:
    """A made-up first number, the glove's own, a jump far ahead, a restart below; one gap, then repaired."""
    file = RunLedger.create(tmp_path / "r.glog", {})
    numbers = [10**9, *range(100, 110), *range(112, 120), *range(10**6, 10**6 + 5), *range(5)]
    for at, number in enumerate(numbers):
        time_ns = at * 8_000_000
        frame = Frame(number, 1, time_ns, time_ns, np.zeros(3, np.float32))
        assert file.add(frame, encode_frame(frame))
    repaired = Frame(110, 1, 0, 0, np.zeros(3, np.float32), flags=int(FrameFlag.REPAIRED))
    assert file.add(repaired, encode_frame(repaired))
    account = file.runs[1].document()
    assert (account["sent"], account["recorded"], account["missing"]) == (31, 30, [[111, 111]])
    file.close()
    again = RunLedger.resume(tmp_path / "r.glog")
    assert again.runs[1].document() == account
    again.close()
