"""Bad frames are told apart and none of them passes; good ones all do."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_service.incoming.frame_gate import TAKEOVER_AFTER_NS, FrameGate, Refusal, RefusalCount, Refused

SECOND = 1_000_000_000


def message(sequence: int, *, run_id: int = 1, at_ns: int | None = None, reading: float = 5.0) -> bytes:
    monotonic_ns = 1000 + 10 * sequence if at_ns is None else at_ns
    return encode_frame(Frame(sequence, run_id, monotonic_ns, 0, np.full(3, reading, np.float32)))


def sealed(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


def refusal(gate: FrameGate, payload: bytes, received_ns: int = 1) -> Refusal:
    with pytest.raises(Refused) as refused:
        gate.pass_frame(payload, received_ns)
    return refused.value.reason


def test_frames_in_order_pass_with_gaps() -> None:
    gate = FrameGate()
    assert [gate.pass_frame(message(n), 1).sequence for n in (0, 1, 5, 6)] == [0, 1, 5, 6]


def test_a_sequence_number_passes_once_and_only_forwards() -> None:
    gate = FrameGate()
    gate.pass_frame(message(7), 1)
    assert refusal(gate, message(7)) is Refusal.DUPLICATE
    assert refusal(gate, message(3)) is Refusal.SEQUENCE_BACKWARDS
    assert gate.pass_frame(message(8), 1).sequence == 8


def test_time_running_backwards_costs_one_frame() -> None:
    gate = FrameGate()
    gate.pass_frame(message(0, at_ns=5000), 1)
    assert refusal(gate, message(1, at_ns=4000)) is Refusal.TIME_BACKWARDS
    assert gate.pass_frame(message(2, at_ns=4500), 1).sequence == 2


def test_damage_version_and_nan_are_told_apart() -> None:
    gate, good = FrameGate(), message(0)
    assert refusal(gate, good[:-5]) is Refusal.DAMAGED
    assert refusal(gate, b"") is Refusal.DAMAGED
    assert refusal(gate, sealed(good[:4] + b"\x02" + good[5:-4])) is Refusal.UNKNOWN_VERSION
    nan = struct.pack("<f", float("nan"))
    assert refusal(gate, sealed(good[:44] + nan + good[48:-4])) is Refusal.NOT_FINITE
    assert gate.run_id is None


@given(st.integers(0, 59), st.integers(1, 255))
def test_a_flipped_byte_never_passes(at: int, flip: int) -> None:
    damaged = bytearray(message(0))
    damaged[at] ^= flip
    assert refusal(FrameGate(), bytes(damaged)) in (Refusal.DAMAGED, Refusal.UNKNOWN_VERSION)


def test_the_first_publisher_keeps_the_glove_until_it_is_silent() -> None:
    gate = FrameGate()
    gate.pass_frame(message(0, run_id=1), SECOND)
    assert refusal(gate, message(0, run_id=2), SECOND + 1) is Refusal.SECOND_PUBLISHER
    gate.pass_frame(message(1, run_id=1), SECOND + 2)
    late = SECOND + 2 + TAKEOVER_AFTER_NS
    assert refusal(gate, message(1, run_id=2), late) is Refusal.SECOND_PUBLISHER
    assert gate.pass_frame(message(2, run_id=2), late + 1).run_id == 2
    assert refusal(gate, message(2, run_id=1), late + 2) is Refusal.SECOND_PUBLISHER
    assert gate.runs == 2


@given(st.lists(st.tuples(st.integers(0, 20), st.integers(0, 2), st.booleans()), max_size=60))
def test_whatever_comes_what_passes_grows(arrivals: list[tuple[int, int, bool]]) -> None:
    gate, count = FrameGate(), RefusalCount("g1")
    passed: list[Frame] = []
    for place, (sequence, run_id, whole) in enumerate(arrivals):
        payload = message(sequence, run_id=run_id)
        try:
            passed.append(gate.pass_frame(payload if whole else payload[:-1], place + 1))
        except Refused as refused:
            count.add(refused)
    assert len(passed) + count.total == len(arrivals)
    assert len({frame.run_id for frame in passed}) <= 1
    sequences = [frame.sequence for frame in passed]
    assert sequences == sorted(set(sequences))
