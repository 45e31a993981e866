"""A packed log is read as it was, byte for byte, whatever was in it; what is damaged is told."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_client import Frame, FrameLog, Recording, encode_frame
from glovecal_client.encryption.kept_file import cut_file, open_kept, pack_log, resume_growing
from glovecal_client.encryption.key_file import KEY_FILE, make_key_file
from glovecal_client.errors import DamagedFile
from glovecal_client.frame_log import header_bytes, record_bytes
from glovecal_client.packed_log import MAGIC, PackedReader, packed_blocks

I64 = st.integers(-(2**63), 2**63 - 1)
U64 = st.integers(0, 2**64 - 1)
FINITE = st.floats(width=32, allow_nan=False, allow_infinity=False)


@st.composite
def frames(draw: st.DrawFn) -> bytes:
    readings = np.array(draw(st.lists(FINITE, min_size=1, max_size=4)), np.float32)
    flags = draw(st.sampled_from([0, 1, 7]))
    return encode_frame(Frame(draw(U64), draw(U64), draw(I64), draw(I64), readings, flags=flags))


FRAMES = frames()
PARTS = st.lists(
    st.one_of(
        FRAMES.map(record_bytes),
        FRAMES.map(lambda frame: record_bytes(frame[:-1] + bytes([frame[-1] ^ 1]))),
        FRAMES.map(lambda frame: record_bytes(frame)[:-3]),
        st.binary(min_size=1, max_size=40).map(record_bytes),
        st.binary(max_size=30),
    ),
    max_size=20,
)


def packed(content: bytes) -> bytes:
    return b"".join(packed_blocks(io.BytesIO(content)))


def read(content: bytes) -> bytes:
    return PackedReader(io.BytesIO(content), "a.glog").readall() or b""


@given(meta=st.booleans(), parts=PARTS)
def test_whatever_lies_in_a_log_is_read_as_it_was(meta: bool, parts: list[bytes]) -> None:
    content = (header_bytes({"glove": "g1"}) if meta else b"") + b"".join(parts)
    assert read(packed(content)) == content


@given(parts=PARTS, data=st.data())
def test_any_part_of_it_is_read_as_of_the_log_itself(parts: list[bytes], data: st.DataObject) -> None:
    content = header_bytes({}) + b"".join(parts)
    log, it = io.BytesIO(content), io.BufferedReader(PackedReader(io.BytesIO(packed(content)), "a.glog"))
    for _ in range(5):
        place, size = data.draw(st.integers(0, len(content) + 5)), data.draw(st.integers(0, 200))
        assert it.seek(place) == log.seek(place)
        assert it.read(size) == log.read(size)
    assert it.seek(-3, os.SEEK_END) == log.seek(-3, os.SEEK_END)


def motion(frames: int) -> list[bytes]:
    """Of 18 sensors at 120 Hz, in whole counts, times with the jitter of a computer."""
    random = np.random.default_rng(0)
    time_s = np.arange(frames) / 120
    waves = np.sin(time_s[:, None] * random.uniform(0.5, 3, 18) + random.uniform(0, 6, 18))
    readings = np.round(120 + 60 * waves + random.normal(0, 1.0, (frames, 18))).astype(np.float32)
    mono = (time_s * 1e9 + random.normal(0, 50_000, frames)).astype(np.int64) + 10**12
    return [
        encode_frame(Frame(number, 7, int(at), int(at) + 10**18 + int(random.normal(0, 300)), row))
        for number, (at, row) in enumerate(zip(mono, readings, strict=True))
    ]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    written = FrameLog.create(tmp_path / "a.glog", {"glove": "g1"})
    for frame in motion(6000):
        written.append(frame)
    written.close()
    os.utime(written.path, (1e9, 1e9))
    return written.path


@pytest.mark.parametrize("is_encrypted", [False, True])
def test_a_frame_takes_a_fifth_and_readers_notice_nothing(
    log: Path, tmp_path: Path, is_encrypted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, content = list(Recording.open(log).places()), log.read_bytes()
    if is_encrypted:
        make_key_file(tmp_path / "key")
        monkeypatch.setenv(KEY_FILE, str(tmp_path / "key"))
    assert pack_log(log)
    assert not pack_log(log)
    assert log.stat().st_mtime == 1e9
    assert (log.read_bytes()[:8] == MAGIC) != is_encrypted
    assert log.stat().st_size / 6000 <= 40 < len(content) / 6000
    with open_kept(log) as file:
        assert file.read() == content
    assert list(Recording.open(log).places()) == before
    assert [each.name for each in tmp_path.iterdir() if each.name.startswith("a.")] == ["a.glog"]


def test_nobody_writes_to_it_any_more(log: Path) -> None:
    pack_log(log)
    content = log.read_bytes()
    with pytest.raises(DamagedFile, match="is packed"):
        resume_growing(log, 100)
    assert cut_file(log, 100) == 0
    assert log.read_bytes() == content


@given(data=st.data())
def test_a_changed_byte_or_a_cut_is_told_and_all_before_it_is_as_it_was(data: st.DataObject) -> None:
    content = header_bytes({}) + b"".join(map(record_bytes, motion(30)))
    sound = packed(content)
    at = data.draw(st.integers(len(MAGIC), len(sound) - 1))
    if data.draw(st.booleans()):
        changed = sound[:at]
    else:
        changed = sound[:at] + bytes([sound[at] ^ (1 << data.draw(st.integers(0, 7)))]) + sound[at + 1 :]
    got, told = read_until_damage(changed)
    assert content.startswith(got)
    assert "a.glog is packed and damaged" in told or got == content


def read_until_damage(content: bytes) -> tuple[bytes, str]:
    reader, got = PackedReader(io.BytesIO(content), "a.glog"), b""
    try:
        while part := reader.read(50):
            got += part
    except DamagedFile as error:
        return got, str(error)
    return got, ""
