"""Finding frames by sequence number in a log that grows, has holes and is damaged behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_client import Frame, FrameLog, decode_frame, encode_frame
from glovecal_client.capture.log_folder import LogIndex

NO_BOUND = 1 << 30


def message(sequence: int) -> bytes:
    return encode_frame(Frame(sequence, 1, sequence, 0, np.array([sequence], np.float32)))


def found(index: LogIndex, first: int, last: int, count: int = NO_BOUND, size: int = NO_BOUND) -> list[int]:
    payloads = index.payloads(first, last, max_count=count, max_bytes=size)
    return [decode_frame(payload).sequence for payload in payloads]


@settings(max_examples=40)
@given(
    sequences=st.sets(st.integers(0, 400), max_size=300).map(sorted),
    split=st.integers(0, 300),
    first=st.integers(0, 420),
    length=st.integers(0, 420),
)
def test_exactly_the_frames_in_the_range_are_found(
    tmp_path_factory, sequences: list[int], split: int, first: int, length: int
) -> None:
    log = FrameLog.create(tmp_path_factory.mktemp("index") / "log", {})
    index = LogIndex(log.path)
    for part in (sequences[:split], sequences[split:]):
        for sequence in part:
            log.append(message(sequence))
        index.extend()
    wanted = [sequence for sequence in sequences if first <= sequence <= first + length]
    assert found(index, first, first + length) == wanted
    assert index.first == (sequences[0] if sequences else None)
    assert index.last == (sequences[-1] if sequences else None)
    log.close()


def test_bounds_of_count_and_bytes_hold(tmp_path: Path) -> None:
    log = FrameLog.create(tmp_path / "log", {})
    for sequence in range(300):
        log.append(message(sequence))
    index = LogIndex(log.path)
    assert found(index, 100, 299, count=3) == [100, 101, 102]
    assert found(index, 100, 299, size=3 * len(message(0)) + 1) == [100, 101, 102]
    log.close()


def test_a_record_half_written_is_left_for_later(tmp_path: Path) -> None:
    log = FrameLog.create(tmp_path / "log", {})
    log.append(message(0))
    log.append(message(1))
    log.close()
    content = log.path.read_bytes()
    log.path.write_bytes(content[:-1])
    index = LogIndex(log.path)
    assert found(index, 0, 9) == [0]
    log.path.write_bytes(content)
    assert found(index, 0, 9) == [0, 1]
