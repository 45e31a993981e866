"""Encrypted files: what is read is what was written, or a refusal, whatever was done to the bytes."""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loopback import eventually

from glovecal_client import DamagedLog, Frame, FrameLog, Recording, encode_frame
from glovecal_client.capture.log_folder import LogFolder, LogIndex
from glovecal_client.encryption.encrypted_file import (
    GROWING,
    HEADER_BYTES,
    OVERHEAD_BYTES,
    SLOT_BYTES,
    WHOLE,
    DecryptingReader,
    EncryptingWriter,
    is_encrypted,
)
from glovecal_client.encryption.kept_file import (
    UNFINISHED,
    create_growing,
    create_whole,
    decrypted,
    encrypted,
    finish_file,
    is_kept_encrypted,
    open_kept,
    read_kept,
    resume_growing,
)
from glovecal_client.encryption.key_file import KEY_FILE, EncryptionKey, make_key_file
from glovecal_client.errors import BadEncryptionKey, DamagedFile, DeviceError, DeviceFinished
from glovecal_client.frame_log import cut_damaged_tail
from glovecal_client.keys import GloveKeys
from glovecal_client.pictures.source import Picture
from glovecal_client.pictures.video_file import VideoFilePictures, VideoWriter

KEY, OTHER_KEY = (EncryptionKey(Path(name), name.encode() * 8) for name in ("here", "away"))
WRITES = st.lists(
    st.integers(0, 300) | st.integers(SLOT_BYTES - 80, SLOT_BYTES + 80) | st.integers(0, 4 * SLOT_BYTES),
    max_size=5,
)
"""Sizes of writes, some about as long as a slot."""
KINDS = st.sampled_from([WHOLE, GROWING])


def use_new_key(place: Path, monkeypatch: pytest.MonkeyPatch, name: str = "disk.key") -> None:
    monkeypatch.setenv(KEY_FILE, str(make_key_file(place / name).file))


def written(kind: bytes, sizes: list[int], seed: int = 0) -> tuple[bytes, bytes]:
    """Content and file."""
    content = np.random.default_rng(seed).bytes(sum(sizes))
    held, begins = io.BytesIO(), 0
    with EncryptingWriter.create(held, KEY, kind) as file:
        for size in sizes:
            assert file.write(content[begins : begins + size]) == size
            begins += size
        file.finish()
        return content, held.getvalue()


def read(sealed: bytes, key: EncryptionKey = KEY) -> DecryptingReader:
    return DecryptingReader(io.BytesIO(sealed), key, "FILE")


def read_up_to_damage(sealed: bytes) -> tuple[bytes, bool]:
    """What can be read from the start, and whether it ends with a refusal."""
    got = bytearray()
    try:
        reader = read(sealed)
        while part := reader.read(1000):
            got += part
    except (DamagedFile, BadEncryptionKey):
        return bytes(got), True
    return bytes(got), False


@settings(max_examples=60, deadline=None)
@given(kind=KINDS, sizes=WRITES, data=st.data())
def test_any_content_is_read_at_any_place(kind: bytes, sizes: list[int], data: st.DataObject) -> None:
    content, sealed = written(kind, sizes)
    reader = read(sealed)
    assert reader.seek(0, io.SEEK_END) == len(content)
    assert reader.read(1) == b""
    for _ in range(5):
        at, size = data.draw(st.integers(0, len(content) + 9)), data.draw(st.integers(0, 2 * SLOT_BYTES))
        reader.seek(at)
        assert io.BufferedReader(reader).read(size) == content[at : at + size] if size else True
        reader = read(sealed)
    assert read(sealed).readall() == content


@settings(max_examples=150, deadline=None)
@given(kind=KINDS, sizes=WRITES, data=st.data())
def test_a_cut_gives_the_content_before_it_and_of_a_whole_file_nothing(
    kind: bytes, sizes: list[int], data: st.DataObject
) -> None:
    content, sealed = written(kind, sizes)
    near = [SLOT_BYTES * slot + HEADER_BYTES for slot in range(len(sealed) // SLOT_BYTES + 1)]
    at = data.draw(st.integers(0, len(sealed) - 1) | st.sampled_from(near))
    if at >= len(sealed):
        return
    got, is_refused = read_up_to_damage(sealed[:at])
    assert content.startswith(got)
    if kind == WHOLE:
        assert (got, is_refused) == (b"", True)
    assert is_encrypted(sealed[:at][:HEADER_BYTES], KEY) == (at > 0)  # an empty file is a plain one


@settings(max_examples=300, deadline=None)
@given(kind=KINDS, sizes=WRITES, data=st.data())
def test_a_flipped_bit_gives_no_wrong_content(kind: bytes, sizes: list[int], data: st.DataObject) -> None:
    content, sealed = written(kind, sizes)
    damaged = bytearray(sealed)
    ahead = st.integers(0, min(len(sealed), 200) - 1)
    damaged[data.draw(st.integers(0, len(sealed) - 1) | ahead)] ^= 1 << data.draw(st.integers(0, 7))
    got, is_refused = read_up_to_damage(bytes(damaged))
    assert content.startswith(got)
    assert is_refused or got == content  # zeros between blocks are nobody's content
    assert is_encrypted(bytes(damaged[:HEADER_BYTES]), KEY)


@settings(max_examples=200, deadline=None)
@given(kind=KINDS, sizes=st.lists(st.sampled_from([40, SLOT_BYTES]), min_size=2, max_size=6), data=st.data())
def test_blocks_that_change_places_give_no_wrong_content(
    kind: bytes, sizes: list[int], data: st.DataObject
) -> None:
    """Within the file, and from another file of the same shape and key."""
    content, sealed = written(kind, sizes)
    other_content, other = written(kind, sizes, seed=1)
    assert content != other_content
    size = data.draw(st.sampled_from([40 + OVERHEAD_BYTES, SLOT_BYTES]))
    starts = list(range(HEADER_BYTES, len(sealed) - size + 1, size)) or [HEADER_BYTES]
    starts += [at + 8 for at in starts]
    one, two = data.draw(st.sampled_from(starts)), data.draw(st.sampled_from(starts))
    moved = bytearray(sealed)
    moved[one : one + size] = data.draw(st.sampled_from([sealed, other]))[two : two + size]
    got, is_refused = read_up_to_damage(bytes(moved))
    assert content.startswith(got)
    assert is_refused or got == content


@pytest.mark.parametrize("kind", [WHOLE, GROWING])
def test_another_key_is_named_and_nothing_is_read(kind: bytes) -> None:
    _, sealed = written(kind, [100])
    with pytest.raises(
        BadEncryptionKey, match=f"key {KEY.id.hex()[:8]}, and away holds .*name the right file"
    ):
        read(sealed, OTHER_KEY)


def test_files_are_as_they_were_without_the_setting(tmp_path: Path) -> None:
    with create_whole(tmp_path / "whole") as file:
        file.write(b"content")
        finish_file(file)
    with create_growing(tmp_path / "growing") as file:
        file.write(b"content")
    assert encrypted(b"content") == (tmp_path / "whole").read_bytes() == b"content"
    assert (tmp_path / "growing").read_bytes() == b"content"
    assert decrypted(b"content", "name") == read_kept(tmp_path / "whole") == b"content"


def test_what_was_written_before_the_setting_stays_readable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "old").write_bytes(b"old")
    use_new_key(tmp_path, monkeypatch)
    assert read_kept(tmp_path / "old") == b"old"
    with resume_growing(tmp_path / "old", 3) as file:
        file.write(b"er")
    assert read_kept(tmp_path / "old") == decrypted(b"older", "name") == b"older"


def test_a_whole_file_whose_writer_failed_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use_new_key(tmp_path, monkeypatch)

    def fail() -> None:
        with create_whole(tmp_path / "file") as file:
            file.write(bytes(3 << 20))
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    with pytest.raises(DamagedFile, match="its end is missing"):
        open_kept(tmp_path / "file")


# The frame log, encrypted.

META = {"glove": "g1", "sensors": ["A", "B"]}
MESSAGES = [encode_frame(Frame(i, 7, i, i, np.array([i, -i], np.float32))) for i in range(5)]


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    use_new_key(tmp_path, monkeypatch)
    log = FrameLog.create(tmp_path / "whole", META)
    for message in MESSAGES:
        assert log.append(message)
    log.close()
    return tmp_path / "whole"


def record_starts(content: bytes) -> list[int]:
    """Where each block starts that holds a record, and the end of the last."""
    at, starts = HEADER_BYTES + 8, []
    while at < len(content):
        at += OVERHEAD_BYTES + int.from_bytes(content[at : at + 4], "little")
        starts.append(at)
    return starts


def test_an_encrypted_log_shows_nothing_and_holds_all(log: Path) -> None:
    content = log.read_bytes()
    for known in (b"GLVLOG1", b"sensors", b"g1", MESSAGES[0][:4], MESSAGES[2]):
        assert known not in content
    recording = Recording.open(log)
    assert recording.meta == META
    assert list(recording.payloads()) == MESSAGES
    with open_kept(log) as file:
        for place, payload in recording.places():
            file.seek(place)
            assert file.read(len(payload)) == payload


def test_an_encrypted_log_cut_at_every_byte_keeps_every_whole_record(log: Path) -> None:
    content = log.read_bytes()
    starts = record_starts(content)
    assert len(starts) == 1 + len(MESSAGES)
    path = log.with_name("cut")
    for length in range(len(content)):
        path.write_bytes(content[:length])
        if length < starts[0]:
            with pytest.raises(DamagedLog, match="cut"):
                FrameLog.resume(path)
            assert path.stat().st_size == length
            continue
        whole = sum(start <= length for start in starts) - 1
        resumed = FrameLog.resume(path)
        assert resumed.records == whole
        resumed.append(b"after")
        resumed.close()
        assert list(Recording.open(path).payloads()) == [*MESSAGES[:whole], b"after"]
        assert b"after" not in path.read_bytes()


def test_an_encrypted_log_cut_where_a_slot_ends_goes_on(log: Path) -> None:
    path, payloads = log.with_name("long"), [b"%0100d" % number for number in range(250)]
    whole = FrameLog.create(path, META)
    for payload in payloads:
        whole.append(payload)
    whole.close()
    content = path.read_bytes()
    slot_end = HEADER_BYTES + SLOT_BYTES
    for length in range(slot_end - 200, slot_end + 200):
        path.write_bytes(content[:length])
        resumed = FrameLog.resume(path)
        kept = resumed.records
        resumed.append(b"after")
        resumed.close()
        assert list(Recording.open(path).payloads()) == [*payloads[:kept], b"after"]
        assert length // 160 < kept < length // 130


def test_an_encrypted_log_with_any_byte_flipped_keeps_the_records_before_it_and_loses_no_bytes(
    log: Path,
) -> None:
    content = log.read_bytes()
    starts = record_starts(content)
    path, kept = log.with_name("flipped"), log.with_name("flipped.cut")
    for at in range(len(content)):
        damaged = bytearray(content)
        damaged[at] ^= 0x41
        path.write_bytes(damaged)
        kept.unlink(missing_ok=True)
        if at < starts[0]:
            with pytest.raises((DamagedLog, BadEncryptionKey), match="flipped"):
                FrameLog.resume(path)
            assert path.read_bytes() == damaged
            continue
        whole = sum(start <= at for start in starts) - 1
        FrameLog.resume(path).close()
        assert list(Recording.open(path).payloads()) == MESSAGES[:whole]
        assert path.read_bytes() + kept.read_bytes() == damaged


def test_zeros_after_a_power_cut_are_cut_off_an_encrypted_log(log: Path) -> None:
    content = log.read_bytes()
    log.write_bytes(content + bytes(4096))
    assert list(Recording.open(log).payloads()) == MESSAGES
    assert cut_damaged_tail(log) == 4096
    assert log.read_bytes() == content


def test_a_killed_writer_of_an_encrypted_log_loses_no_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use_new_key(tmp_path, monkeypatch)
    writer = (
        "import os, signal, sys; from glovecal_client import FrameLog\n"
        "log = FrameLog.create(sys.argv[1], {})\n"
        "for i in range(5000): log.append(b'%d' % i)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    path = tmp_path / "log"
    assert subprocess.run([sys.executable, "-c", writer, str(path)], check=False).returncode == -9
    assert [int(payload) for payload in Recording.open(path).payloads()] == list(range(5000))


@pytest.mark.parametrize("key", ["none", "another"])
def test_without_its_key_a_log_is_neither_read_nor_cut(
    log: Path, key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = log.read_bytes()[:-1]
    log.write_bytes(content)
    if key == "none":
        monkeypatch.delenv("GLOVECAL_ENCRYPTION_KEY_FILE")
    else:
        use_new_key(tmp_path, monkeypatch, "another.key")
    for attempt in (FrameLog.resume, Recording.open):
        with pytest.raises(BadEncryptionKey, match="whole is encrypted with the key"):
            attempt(log)
    assert log.read_bytes() == content
    assert not log.with_name("whole.cut").exists()


# Videos and label images.


def test_an_encrypted_film_is_as_it_was_drawn_and_is_read_up_to_where_it_was_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("cv2")
    use_new_key(tmp_path, monkeypatch)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    film, random = tmp_path / "film.mkv", np.random.default_rng(1)
    pictures = [Pixels(random.integers(0, 255, (48, 64, 3), np.uint8)) for _ in range(40)]
    writer = VideoWriter(film, 30.0)
    for number, drawn in enumerate(pictures):
        writer.write(Picture(drawn.pixels, number * 33_000_000, number))
    assert list((tmp_path / "temporary").iterdir()) == []
    writer.close()
    content = film.read_bytes()
    assert b"matroska" not in content
    assert frames_of(film) == (pictures, "is over after 40 pictures")
    film.write_bytes(content[: len(content) // 2])
    kept, said = frames_of(film)
    assert 10 < len(kept) < 40
    assert kept == pictures[: len(kept)]
    assert "ends in the middle" in said


def frames_of(film: Path) -> tuple[list[Pixels], str]:
    source, found = VideoFilePictures(film), []
    source.open()
    try:
        while True:
            found.append(Pixels(source.read().pixels))
    except DeviceFinished as ended:
        return found, str(ended).removeprefix(f"video:{film} ")
    finally:
        source.close()


class Pixels:
    """Of a picture; equal where all are."""

    def __init__(self, pixels: np.ndarray) -> None:
        self.pixels = pixels

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Pixels) and np.array_equal(self.pixels, other.pixels)

    __hash__ = None  # type: ignore[assignment]


def test_a_film_whose_disk_is_full_says_so_and_holds_nobody_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("cv2")
    use_new_key(tmp_path, monkeypatch)
    written = 0

    def is_full(self: EncryptingWriter, content: bytes) -> int:
        nonlocal written
        written += len(content)
        if written > 50_000:
            raise OSError(28, "No space left on device")
        return len(content)

    monkeypatch.setattr(EncryptingWriter, "write", is_full)
    writer = VideoWriter(tmp_path / "film.mkv", 30.0)
    pixels = np.random.default_rng(1).integers(0, 255, (240, 320, 3), np.uint8)

    def film() -> None:
        for number in range(500):
            writer.write(Picture(pixels, number, number))

    with pytest.raises(DeviceError, match=r"film.mkv: No space left on device"):
        film()
    writer.close()


def test_earlier_logs_are_encrypted_beside_a_capture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys, told = GloveKeys("lab", "g1"), []
    folder = LogFolder(tmp_path / "data", keys)
    log = folder.create(7, META)
    for message in MESSAGES:
        log.append(message)
    log.close()
    index = LogIndex(log.path)
    index.extend()
    folder.close()
    use_new_key(tmp_path, monkeypatch)
    folder = LogFolder(tmp_path / "data", keys)
    (folder.path / f"{log.path.name}.1234{UNFINISHED}").write_bytes(b"of one that was killed")
    folder.encrypt_earlier(told.append)
    eventually(lambda: told, "it is told")
    folder.close()
    assert told == [f"earlier recording {log.path.name} is encrypted now"]
    assert sorted(path.name for path in folder.path.iterdir()) == [log.path.name, "lock"]
    assert is_kept_encrypted(log.path)
    assert index.payloads(2, 3, max_count=9, max_bytes=1 << 20) == MESSAGES[2:4]


def test_an_encrypted_film_needs_a_pipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cv2")
    use_new_key(tmp_path, monkeypatch)

    def none(path: Path) -> None:
        raise OSError(38, "Windows has no pipes with paths")

    monkeypatch.setattr("glovecal_client.pictures.encrypted_video.named_pipe", none)
    writer = VideoWriter(tmp_path / "film.mkv", 30.0)
    with pytest.raises(DeviceError, match="cannot be encrypted while it is written: Windows has no pipes"):
        writer.write(Picture(np.zeros((48, 64, 3), np.uint8), 0, 0))
    writer.close()
    assert not (tmp_path / "film.mkv").exists()
