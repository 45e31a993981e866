"""Time code out of sounds: made bit by bit from the standard's table, noisy, cut, jumping, and by libltc."""

from __future__ import annotations

import ctypes
import ctypes.util
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ltc_sound import ltc_sound, write_wav

from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import RATES, Counting
from glovecal_service.ltc import decode_ltc, read_ltc

BEGIN_S = 0.1
SOUNDS = [
    ("23.976", False, 48_000), ("24", False, 44_100), ("25", False, 48_000), ("29.97", False, 48_000),
    ("29.97", True, 44_100), ("30", False, 96_000),
]  # fmt: skip


def labels_from(counting: Counting, frame: int, count: int) -> list[tuple[int, int, int, int]]:
    texts = [counting.label(frame + n).replace(";", ":").split(":") for n in range(count)]
    return [(int(h), int(m), int(s), int(f)) for h, m, s, f in texts]


def sound_of(
    rate: str, drop: bool, samples_per_s: int, *, count: int = 100
) -> tuple[Counting, list, np.ndarray]:
    counting = Counting(rate, drop)
    labels = labels_from(counting, counting.frame(9, 59, 58, 20), count)
    return counting, labels, ltc_sound(
        labels, float(RATES[rate]), samples_per_s, begin_s=BEGIN_S, drop=drop
    )  # fmt: skip


def whole(labels: list) -> list:
    """Frames with an edge at either end: the first one follows silence, and so does the last one's end."""
    return labels[1:-1]


@pytest.mark.parametrize(("rate", "drop", "samples_per_s"), SOUNDS)
def test_every_frame_is_read_where_it_begins(
    rate: str, drop: bool, samples_per_s: int, tmp_path: Path
) -> None:
    counting, labels, sound = sound_of(rate, drop, samples_per_s)
    frames = decode_ltc(sound, samples_per_s)
    assert frames.labels.tolist() == [list(label) for label in whole(labels)]
    expected = BEGIN_S + np.arange(1, len(labels) - 1) / float(counting.frames_per_s)
    assert np.abs(frames.start_s - expected).max() < 5e-6
    found = read_ltc(write_wav(tmp_path / "t.wav", 0.5 * sound[:, None], samples_per_s))
    code = found.time_code
    assert (code.rate, code.drop, found.unused) == (rate, drop, 0)
    assert code.at(BEGIN_S + 1e-3) == counting.label(counting.frame(*labels[0]))
    assert abs(code.time_s - expected[0]) < 5e-6
    assert abs(found.drift_ppm) < 5


@pytest.mark.parametrize("width", [1, 2, 3, 4])
def test_wav_files_of_all_widths_and_the_channel_with_the_time_code(width: int, tmp_path: Path) -> None:
    _, labels, sound = sound_of("25", False, 48_000, count=30)
    speech = 0.3 * np.sin(np.arange(len(sound)) / 40) * np.sin(np.arange(len(sound)) / 9000)
    path = write_wav(tmp_path / "t.wav", np.stack([speech, 0.2 * sound], axis=1), width=width)
    found = read_ltc(path)
    assert (found.channel, found.frames) == (2, len(labels) - 2)
    with pytest.raises(BadInput, match=r"holds no time code \(LTC\) in channel 1"):
        read_ltc(path, channel=1)
    with pytest.raises(BadInput, match="has channels 1 to 2, not 3"):
        read_ltc(path, channel=3)


def test_noise_hum_and_a_polarity_that_is_turned() -> None:
    _, labels, sound = sound_of("25", False, 48_000, count=500)
    rng = np.random.default_rng(3)
    time_s = np.arange(len(sound)) / 48_000
    dirty = -0.1 * sound + 0.03 * np.sin(2 * np.pi * 50 * time_s) + 0.006 * rng.standard_normal(len(sound))
    frames = decode_ltc(dirty, 48_000)
    assert [tuple(label) for label in frames.labels.tolist()] == whole(labels)
    assert np.abs(np.diff(frames.start_s) - 0.04).max() < 50e-6


def test_frames_across_blocks_come_once() -> None:
    """A minute and a half: three blocks of the decoder."""
    _, labels, sound = sound_of("30", False, 16_000, count=2700)
    frames = decode_ltc(sound, 16_000)
    assert [tuple(label) for label in frames.labels.tolist()] == whole(labels)


def test_a_time_code_that_jumps_is_used_where_it_is_longest(tmp_path: Path) -> None:
    counting = Counting("25")
    short = labels_from(counting, counting.frame(1, 0, 0, 0), 40)
    long = labels_from(counting, counting.frame(2, 0, 0, 0), 60)
    sound = ltc_sound([*short, *long], 25.0, begin_s=BEGIN_S)
    found = read_ltc(write_wav(tmp_path / "t.wav", sound[:, None]))
    assert (found.frames, found.unused) == (59, 39)
    assert found.time_code.at(BEGIN_S + 40 / 25 + 1e-3) == "02:00:00:00"
    assert "the time code jumped or stood" in " ".join(found.sentences)


def test_frames_cut_in_the_middle_are_left_out() -> None:
    _, labels, sound = sound_of("25", False, 48_000, count=50)
    sound[48_000 : 48_000 + 4000] = 0.0  # 83 ms of it: two or three frames are touched
    frames = decode_ltc(sound, 48_000)
    read = [tuple(label) for label in frames.labels.tolist()]
    assert set(read) < set(labels)
    assert len(read) >= len(labels) - 5


def test_a_rate_that_is_off_is_measured_and_told(tmp_path: Path) -> None:
    counting = Counting("25")
    labels = labels_from(counting, 0, 200)
    path = write_wav(tmp_path / "t.wav", ltc_sound(labels, 25.0 * 1.001)[:, None])
    found = read_ltc(path)
    assert found.time_code.rate == "25"
    assert found.drift_ppm == pytest.approx(1000, abs=5)
    assert "1000 ppm faster than 25" in " ".join(found.sentences)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [(b"", "cannot be read as WAV"), (b"RIFF....WAVEfmt ", "cannot be read as WAV"), (b"OggS", "cannot be")],
)
def test_what_is_no_wav_is_refused(content: bytes, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "t.wav"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=complaint):
        read_ltc(path)


@given(content=st.binary(max_size=400), at=st.integers(0, 60))
def test_wild_wav_files_are_refused(
    content: bytes, at: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A good file's beginning and anything after it."""
    path = tmp_path_factory.getbasetemp() / "wild.wav"
    good = write_wav(path, np.zeros((100, 2))).read_bytes()
    path.write_bytes(good[:at] + content)
    with pytest.raises(BadInput):
        read_ltc(path)


@pytest.mark.parametrize("samples_per_s", [8000, 11_025, 192_000])
def test_low_and_high_sample_rates(samples_per_s: int) -> None:
    _, labels, sound = sound_of("25", False, samples_per_s, count=50)
    frames = decode_ltc(sound, samples_per_s)
    assert [tuple(label) for label in frames.labels.tolist()] == whole(labels)


def test_noise_silence_and_music_hold_no_time_code(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    time_s = np.arange(96_000) / 48_000
    for sound in (0.3 * rng.standard_normal(96_000), np.zeros(96_000), np.sin(2 * np.pi * 2000 * time_s)):
        with pytest.raises(BadInput, match="holds no time code"):
            read_ltc(write_wav(tmp_path / "t.wav", sound[:, None]))


def test_sounds_that_libltc_makes_are_read() -> None:
    """An encoder that nobody here wrote; Debian's package libltc11."""
    name = ctypes.util.find_library("ltc")
    if name is None:
        pytest.skip("libltc is not installed: apt-get install libltc11")
    sound = sound_of_libltc(ctypes.CDLL(name), count=250)
    frames = decode_ltc(sound, 48_000)
    expected = labels_from(Counting("25"), Counting("25").frame(10, 59, 58, 0), 250)
    assert [tuple(label) for label in frames.labels.tolist()] == expected[1 : 1 + len(frames)]
    assert len(frames) >= 248
    assert np.abs(np.diff(frames.start_s) - 0.04).max() < 5e-6


class SmpteTime(ctypes.Structure):
    _fields_ = (
        ("zone", ctypes.c_char * 6), ("years", ctypes.c_ubyte), ("months", ctypes.c_ubyte),
        ("days", ctypes.c_ubyte), ("hours", ctypes.c_ubyte), ("mins", ctypes.c_ubyte),
        ("secs", ctypes.c_ubyte), ("frame", ctypes.c_ubyte),
    )  # fmt: skip


def sound_of_libltc(library: ctypes.CDLL, *, count: int) -> np.ndarray:
    """25 frames a second from 10:59:58:00 on, 48 kHz."""
    create = library.ltc_encoder_create
    create.restype, create.argtypes = (
        ctypes.c_void_p,
        [ctypes.c_double, ctypes.c_double, ctypes.c_int, ctypes.c_int],
    )
    encoder, parts = ctypes.c_void_p(create(48_000.0, 25.0, 1, 0)), []
    library.ltc_encoder_set_timecode(encoder, ctypes.byref(SmpteTime(b"+0000", 26, 11, 27, 10, 59, 58, 0)))
    for _ in range(count):
        library.ltc_encoder_encode_frame(encoder)
        buffer = ctypes.create_string_buffer(4096)
        length = library.ltc_encoder_get_buffer(encoder, buffer)
        parts.append(np.frombuffer(buffer.raw[:length], np.uint8))
        library.ltc_encoder_inc_timecode(encoder)
    library.ltc_encoder_free(encoder)
    return (np.concatenate(parts).astype(float) - 128) / 128
