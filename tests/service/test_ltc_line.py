"""Time code from a line: sound made bit by bit, in blocks that come late, damaged and lost."""

from __future__ import annotations

import gc
import io
import struct
import tracemalloc
from collections.abc import Iterable
from itertools import islice

import numpy as np
import pytest
from ltc_sound import endless_ltc, pcm

from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import Counting
from glovecal_service.ltc_line import ListeningLine, LtcLine, SoundForm, read_form

SAMPLES_PER_S = 12_000
BLOCK_S = 0.0625
TEN = 25 * 36_000
"""10:00:00:00"""


class Told(list[str]):
    def __call__(self, sentence: str) -> None:
        self.append(sentence)


def seconds(count: int, first: int = TEN) -> np.ndarray:
    return np.concatenate(list(islice(endless_ltc(first, SAMPLES_PER_S), count)))


def feed(
    line: LtcLine, sound: np.ndarray, begin_s: float, late_s: Iterable[float] = (), width: int = 2
) -> None:
    """``sound`` (N,) or (N, channels) began at ``begin_s`` and comes in blocks of an odd number of bytes."""
    channels = sound if sound.ndim == 2 else sound[:, None]
    content, size = pcm(channels, width), channels.shape[1] * width
    step = round(BLOCK_S * SAMPLES_PER_S) * size + 1
    for number, (at, late) in enumerate(
        zip(range(0, len(content), step), [*late_s, *[0.0] * len(content)], strict=False)
    ):
        heard_s = min(len(content), step * (number + 1)) // size / SAMPLES_PER_S
        line.take(content[at : at + step], round(1e9 * (begin_s + heard_s + late)))


def expected(now_s: float, begin_s: float, first: int = TEN) -> str:
    return Counting("25").label(first + int((now_s - begin_s) * 25))


NOW_S = 5000.0
"""Of the clock, at the end of each test."""


def new_line(told: Told, form: SoundForm | None = None) -> LtcLine:
    return LtcLine(form or SoundForm(SAMPLES_PER_S), None, tell=told, now_s=lambda: NOW_S)


def test_it_tells_what_runs_now_however_late_blocks_come() -> None:
    told, rng = Told(), np.random.default_rng(1)
    line, begin_s = new_line(told), NOW_S - 4.0
    assert line.time_code is None
    late_s = rng.exponential(0.02, 64)
    late_s[::7] = 0.0
    feed(line, 0.3 * seconds(4), begin_s, late_s)
    code = line.time_code
    assert code is not None
    assert (code.rate, code.drop, code.source) == ("25", False, "LTC of a line")
    for later_s in (0.01, 1.0, 60.0):
        assert code.at(begin_s + later_s + 0.005) == expected(begin_s + later_s + 0.005, begin_s)
    line.look()
    line.look()
    (sentence,) = told
    assert sentence.startswith("Time code on the line: 10:00:0")


def test_the_channel_with_time_code_is_found_in_24_bits() -> None:
    told, sound = Told(), seconds(2)
    speech = 0.3 * np.sin(np.arange(len(sound)) / 40)
    line, begin_s = new_line(told, SoundForm(SAMPLES_PER_S, 2, 3)), NOW_S - 2.0
    feed(line, np.stack([speech, 0.2 * sound], axis=1), begin_s, width=3)
    assert line.time_code is not None
    assert line.time_code.at(begin_s + 0.005) == "10:00:00:00"


def test_a_signal_that_is_lost_is_told_and_so_is_its_return() -> None:
    told, begin_s = Told(), NOW_S - 6.0
    line = new_line(told)
    line.look()
    assert told == [], "nothing was ever there: takes say so"
    feed(line, seconds(3), begin_s)
    assert line.time_code is None, "the last frame is three seconds old"
    line.look()
    (sentence,) = told
    assert sentence.startswith("No time code on the line since 10:00:02:2")
    feed(line, np.concatenate([np.zeros(SAMPLES_PER_S), seconds(2, TEN + 100)]), begin_s + 3.0)
    line.look()
    assert told[1].startswith("Time code on the line: 10:00:0"), "it went on while nothing was heard"


def test_a_jump_is_told_and_the_new_labels_hold() -> None:
    told, begin_s = Told(), NOW_S - 4.0
    line = new_line(told)
    feed(line, np.concatenate([seconds(2), seconds(2, 2 * TEN)]), begin_s)
    assert told == ["The time code on the line jumped from 10:00:02:00 to 20:00:00:00."]
    assert line.time_code is not None
    assert line.time_code.at(begin_s + 2.005) == "20:00:00:00"


def test_lost_sound_is_told_and_times_are_right_again() -> None:
    told, begin_s = Told(), NOW_S - 9.0
    line, sound = new_line(told), seconds(9)
    feed(line, sound[: 3 * SAMPLES_PER_S], begin_s)
    feed(line, sound[round(3.4 * SAMPLES_PER_S) :], begin_s + 3.4)
    assert any("0.40 s of the line's sound were lost" in sentence for sentence in told), told
    assert line.time_code is not None
    now_s = begin_s + 8.9
    assert line.time_code.at(now_s) == expected(now_s, begin_s)


def test_it_keeps_no_more_after_a_minute() -> None:
    line, begin_s = new_line(Told()), NOW_S - 60.0
    second = [pcm(part[:, None]) for part in islice(endless_ltc(TEN, SAMPLES_PER_S), 60)]

    # what the line holds, not what other threads of this process or first calls of a library do
    held_by_line = tracemalloc.Filter(True, "*/glovecal_service/ltc*", all_frames=True)

    def feed_seconds(low: int, high: int) -> int:
        for number in range(low, high):
            line.take(second[number], round(1e9 * (begin_s + number + 1)))
        gc.collect()
        traces = tracemalloc.take_snapshot().filter_traces([held_by_line]).statistics("filename")
        return sum(held.size for held in traces)

    tracemalloc.start(10)
    try:
        before = feed_seconds(0, 10)
        assert feed_seconds(10, 60) - before < 100_000, "bytes"
    finally:
        tracemalloc.stop()
    assert line.time_code is not None


def test_noise_has_no_time_code() -> None:
    told = Told()
    line = new_line(told)
    noise = 0.3 * np.random.default_rng(0).standard_normal(2 * SAMPLES_PER_S)
    feed(line, noise, NOW_S - 2.0)
    line.look()
    assert (line.time_code, told) == (None, [])


def header(
    *, tag: int = 1, channels: int = 1, per_s: int = 48_000, bits: int = 16, before: bytes = b""
) -> bytes:
    form = struct.pack(
        "<HHIIHH", tag, channels, per_s, per_s * channels * bits // 8, channels * bits // 8, bits
    )
    chunk = b"fmt " + struct.pack("<I", len(form)) + form
    return b"RIFF\xff\xff\xff\xffWAVE" + before + chunk + b"data\xff\xff\xff\xff"


def test_wav_streams_of_any_length_are_read() -> None:
    assert read_form(io.BytesIO(header())) == SoundForm(48_000, 1, 2)
    other = header(tag=0xFFFE, channels=2, bits=24, before=b"LIST\x05\0\0\0abcde\0")
    assert read_form(io.BytesIO(other)) == SoundForm(48_000, 2, 3)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "ended before any sound"),
        (b"\0" * 100, "does not begin as a WAV stream"),
        (header()[:-8], "ended before any sound"),
        (b"RIFF\0\0\0\0WAVEdata\0\0\0\0", "says nothing of the samples"),
        (header(tag=3, bits=32), "not PCM"),
        (header(per_s=4000), "record 1 to 8 with 8000 or more"),
        (header(channels=64), "64 channels"),
        (b"RIFF\0\0\0\0WAVEjunk\xff\xff\xff\x7f", "header is damaged"),
    ],
)
def test_other_streams_are_refused(content: bytes, why: str) -> None:
    with pytest.raises(BadInput, match=why):
        read_form(io.BytesIO(content))


def test_a_file_is_no_line(tmp_path) -> None:
    file = tmp_path / "sound.wav"
    file.write_bytes(header())
    with pytest.raises(BadInput, match="is a file, no line: after the recording, glovecal take timecode"):
        ListeningLine(str(file), None, tell=print)
    with pytest.raises(BadInput, match="make it: mkfifo"):
        ListeningLine(str(tmp_path / "none"), None, tell=print)
