"""Drop-frame arithmetic against counting one by one, labels of a take's times, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import RATES, WITH_DROP, Counting, TimeCode

COUNTED = [(rate, False) for rate in RATES] + [(rate, True) for rate in WITH_DROP]


def counted(numbers_a_second: int, drop: bool, minutes: int) -> Iterator[tuple[int, int, int, int]]:
    """Hours, minutes, seconds and number of every frame, as SMPTE 12M counts: with drop-frame the first two
    numbers (of 60: four) of a minute are left out, unless it is a multiple of ten."""
    for minute in range(minutes):
        for second in range(60):
            for number in range(numbers_a_second):
                if not (drop and minute % 10 and second == 0 and number < numbers_a_second // 15):
                    yield minute // 60, minute % 60, second, number


@pytest.mark.parametrize(("rate", "drop"), COUNTED)
def test_labels_are_those_of_counting_one_by_one(rate: str, drop: bool) -> None:
    counting = Counting(rate, drop)
    for frame, parts in enumerate(counted(round(float(RATES[rate])), drop, 62)):
        hours, minutes, seconds, number = parts
        label = f"{hours:02d}:{minutes:02d}:{seconds:02d}{';' if drop else ':'}{number:02d}"
        assert counting.label(frame) == label
        assert counting.frame(*parts) == frame


@pytest.mark.parametrize(("rate", "drop"), COUNTED)
@given(part=st.floats(0, 1, exclude_max=True))
def test_a_label_leads_back_to_its_frame(rate: str, drop: bool, part: float) -> None:
    counting = Counting(rate, drop)
    frame = int(part * counting.frames_per_day)
    assert counting.frame(*map(int, counting.label(frame).replace(";", ":").split(":"))) == frame


def test_drop_frame_keeps_to_the_clock() -> None:
    counting = Counting("29.97", drop=True)
    assert counting.label(1799) == "00:00:59;29"
    assert counting.label(1800) == "00:01:00;02"
    assert counting.label(17982) == "00:10:00;00"
    assert counting.label(counting.frames_per_day) == "00:00:00;00"
    assert abs(counting.frames_per_day / float(counting.frames_per_s) - 86400) < 0.1


def test_a_take_has_its_label_at_every_time() -> None:
    code = TimeCode.of_text("00:00:59;28", None, 100.0, "a test")
    per_frame = 1001 / 30000
    assert [code.at(100.0 + n * per_frame) for n in range(4)] == [
        "00:00:59;28", "00:00:59;29", "00:01:00;02", "00:01:00;03",
    ]  # fmt: skip
    assert code.at(100.0 - 1e-3) == "00:00:59;27"
    assert TimeCode.of_text("00:00:00:00", "25", 0.0, "").at(-0.02) == "23:59:59:24"
    assert TimeCode.of_document(code.document()) == code


@given(frame=st.integers(0, 10**7), begin_s=st.floats(0, 1e6))
def test_a_time_computed_from_a_frame_is_in_that_frame(frame: int, begin_s: float) -> None:
    code = TimeCode.of_text("01:00:00:00", "29.97", begin_s, "")
    expected = code.counting.label(108_000 + frame)
    assert code.at(begin_s + frame * 1001 / 30000) == expected


@pytest.mark.parametrize(
    ("text", "rate", "complaint"),
    [
        ("00:01:00;00", None, "there is no time code 00:01:00;00 at 29.97 drop-frame frames a second"),
        ("00:00:00:25", "25", "there is no time code 00:00:00:25"),
        ("24:00:00:00", "25", "there is no time code"),
        ("00:00:00:00", None, "does not tell its frame rate"),
        ("00:00:00:00", "26", "no frame rate '26'"),
        ("00:00:00;00", "25", "drop-frame counting is of 29.97 and 59.94"),
        ("00:00:00.000", "25", "is no time code"),
        ("", "25", "is no time code"),
    ],
)
def test_what_is_no_time_code_is_refused(text: str, rate: str | None, complaint: str) -> None:
    with pytest.raises(BadInput, match=complaint):
        TimeCode.of_text(text, rate, 0.0, "")
