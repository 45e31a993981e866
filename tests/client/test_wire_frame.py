"""Frames on the wire: the golden file, round trips, and damage that must be refused."""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from glovecal_client import Frame, FrameFlag, WireError, decode_frame, encode_frame
from glovecal_client.wire.frame import MAX_FRAME_BYTES

GOLDEN = Path(__file__).parent / "golden"
VALUES = json.loads((GOLDEN / "frame_v1.json").read_text())
MESSAGE = (GOLDEN / "frame_v1.bin").read_bytes()

u64 = st.integers(0, 2**64 - 1)
i64 = st.integers(-(2**63), 2**63 - 1)
float32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
frames = st.builds(
    Frame,
    sequence=u64,
    run_id=u64,
    monotonic_ns=i64,
    wall_ns=i64,
    readings=hnp.arrays(np.float32, st.integers(1, 40), elements=float32),
    context=hnp.arrays(np.float32, st.integers(0, 5), elements=float32 | st.just(np.float32(np.nan))),
    flags=st.integers(0, 255),
)


def golden_frame() -> Frame:
    context = [np.nan if value is None else value for value in VALUES["context"]]
    return Frame(
        VALUES["sequence"],
        VALUES["run_id"],
        VALUES["monotonic_ns"],
        VALUES["wall_ns"],
        np.array(VALUES["readings"], np.float32),
        np.array(context, np.float32),
        VALUES["flags"],
    )


def test_golden_frame_is_read_and_written_to_the_byte() -> None:
    frame = decode_frame(MESSAGE)
    for name in ("sequence", "run_id", "monotonic_ns", "wall_ns", "flags"):
        assert getattr(frame, name) == VALUES[name]
    assert frame.readings.tolist() == VALUES["readings"]
    assert frame.context[0] == VALUES["context"][0]
    assert np.isnan(frame.context[1])
    assert frame.button
    assert frame.simulated
    assert not frame.repaired
    assert encode_frame(golden_frame()) == MESSAGE


def test_checksum_is_the_crc32_of_the_standard() -> None:
    assert zlib.crc32(b"123456789") == 0xCBF43926


@given(frames)
def test_what_is_written_is_read_back(frame: Frame) -> None:
    message = encode_frame(frame)
    assert len(message) == 48 + 4 * len(frame.readings) + 4 * len(frame.context) <= MAX_FRAME_BYTES
    again = decode_frame(message)
    for name in ("sequence", "run_id", "monotonic_ns", "wall_ns", "flags"):
        assert getattr(again, name) == getattr(frame, name)
    np.testing.assert_array_equal(again.readings, frame.readings)
    np.testing.assert_array_equal(again.context, frame.context)


def test_every_truncation_is_refused() -> None:
    for length in range(len(MESSAGE)):
        with pytest.raises(WireError):
            decode_frame(MESSAGE[:length])


def test_every_flipped_bit_is_refused() -> None:
    for bit in range(8 * len(MESSAGE)):
        damaged = bytearray(MESSAGE)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(WireError):
            decode_frame(bytes(damaged))


@given(st.binary(max_size=200))
def test_arbitrary_bytes_are_refused_with_a_sentence(message: bytes) -> None:
    with pytest.raises(WireError, match=r"^frame: .*\w"):
        decode_frame(message)


@given(st.binary(max_size=120))
def test_an_honest_checksum_does_not_make_nonsense_a_frame(rest: bytes) -> None:
    body = b"GLVF\x01" + rest
    message = body + struct.pack("<I", zlib.crc32(body))
    try:
        frame = decode_frame(message)
    except WireError:
        return
    assert np.isfinite(frame.readings).all()
    assert len(message) == 48 + 4 * len(frame.readings) + 4 * len(frame.context)


def test_longer_messages_are_refused() -> None:
    with pytest.raises(WireError, match="need"):
        decode_frame(MESSAGE + b"\0")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_readings_that_are_no_numbers_are_neither_written_nor_read(bad: float) -> None:
    frame = Frame(0, 1, 0, 0, np.array([1.0, bad], np.float32))
    with pytest.raises(WireError, match="sensor 1 reads"):
        encode_frame(frame)
    body = bytearray(encode_frame(Frame(0, 1, 0, 0, np.array([1.0, 2.0], np.float32)))[:-4])
    body[48:52] = struct.pack("<f", bad)
    with pytest.raises(WireError, match="sensor 1 reads"):
        decode_frame(bytes(body) + struct.pack("<I", zlib.crc32(body)))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"readings": np.empty(0)}, "1 to 1024 sensors"),
        ({"readings": np.zeros(1025)}, "1 to 1024 sensors"),
        ({"readings": np.zeros((2, 2))}, "shape"),
        ({"context": np.zeros(257)}, "0 to 256"),
        ({"context": np.array([np.inf])}, "infinite"),
        ({"sequence": -1}, "does not fit"),
        ({"sequence": 2**64}, "does not fit"),
        ({"flags": 256}, "does not fit"),
    ],
)
def test_values_outside_the_format_are_refused(change: dict, sentence: str) -> None:
    values = {"sequence": 0, "run_id": 0, "monotonic_ns": 0, "wall_ns": 0, "readings": np.zeros(2)}
    with pytest.raises(WireError, match=sentence):
        encode_frame(Frame(**(values | change)))


def test_flag_bits_are_those_of_the_document() -> None:
    assert (FrameFlag.BUTTON, FrameFlag.SIMULATED, FrameFlag.REPAIRED) == (1, 2, 4)
