"""Ranges of recorded sequence numbers against plain sets."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from glovecal_service.realtime.sequence_ranges import SequenceRanges

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
