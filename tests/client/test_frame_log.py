"""The frame log against truncation, damage, a full disk and a dying process."""

from __future__ import annotations

import resource
import subprocess
import sys
import threading
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from loopback import eventually

from glovecal_client import DamagedLog, Frame, FrameLog, Recording, encode_frame
from glovecal_client.frame_log import MAX_RECORD_BYTES, MAX_WAITING, BackgroundSync, cut_damaged_tail

META = {"glove": "g1", "sensors": ["A", "B"]}
MESSAGES = [encode_frame(Frame(i, 7, i, i, np.array([i, -i], np.float32))) for i in range(5)]


def write_log(path: Path, messages: list[bytes] = MESSAGES) -> bytes:
    log = FrameLog.create(path, META)
    for message in messages:
        assert log.append(message)
    log.close()
    return path.read_bytes()


def record_starts(content: bytes) -> list[int]:
    """Where each record starts, and the end of the last: worked out from the document, not by the reader."""
    at = 16 + int.from_bytes(content[8:12], "little")
    starts = [at]
    while at < len(content):
        at += 8 + int.from_bytes(content[at : at + 4], "little")
        starts.append(at)
    return starts


def test_log_is_as_documented(tmp_path: Path) -> None:
    content = write_log(tmp_path / "a.glvlog")
    assert content.startswith(b"GLVLOG1\n")
    first = record_starts(content)[0]
    assert int.from_bytes(content[12:16], "little") == zlib.crc32(content[16:first])
    assert int.from_bytes(content[first + 4 : first + 8], "little") == zlib.crc32(MESSAGES[0])
    assert record_starts(content)[-1] == len(content)
    recording = Recording.open(tmp_path / "a.glvlog")
    assert recording.meta == META
    assert list(recording.payloads()) == MESSAGES
    assert [frame.sequence for frame in recording.frames()] == [0, 1, 2, 3, 4]


def test_log_cut_at_every_byte_keeps_every_whole_record(tmp_path: Path) -> None:
    content = write_log(tmp_path / "whole")
    starts = record_starts(content)
    path = tmp_path / "cut"
    for length in range(len(content)):
        path.write_bytes(content[:length])
        if length < starts[0]:
            with pytest.raises(DamagedLog, match="cut"):
                FrameLog.resume(path)
            assert path.stat().st_size == length
            continue
        whole = sum(start <= length for start in starts) - 1
        log = FrameLog.resume(path)
        assert log.records == whole
        log.append(b"after")
        log.close()
        assert list(Recording.open(path).payloads()) == [*MESSAGES[:whole], b"after"]


def test_log_with_any_byte_flipped_keeps_the_records_before_it_and_loses_no_bytes(tmp_path: Path) -> None:
    content = write_log(tmp_path / "whole")
    starts = record_starts(content)
    path = tmp_path / "flipped"
    kept = tmp_path / "flipped.cut"
    for at in range(len(content)):
        damaged = bytearray(content)
        damaged[at] ^= 0x41
        path.write_bytes(damaged)
        kept.unlink(missing_ok=True)
        if at < starts[0]:
            with pytest.raises(DamagedLog, match="flipped"):
                FrameLog.resume(path)
            continue
        whole = sum(start <= at for start in starts) - 1
        FrameLog.resume(path).close()
        assert list(Recording.open(path).payloads()) == MESSAGES[:whole]
        assert path.read_bytes() + kept.read_bytes() == damaged


def test_zeros_after_a_power_cut_are_not_records(tmp_path: Path) -> None:
    path = tmp_path / "log"
    content = write_log(path)
    path.write_bytes(content + bytes(4096))
    assert cut_damaged_tail(path) == 4096
    assert path.read_bytes() == content
    assert cut_damaged_tail(path) == 0


@pytest.mark.parametrize("payload", [b"", bytes(MAX_RECORD_BYTES + 1)])
def test_payloads_that_do_not_fit_are_refused(tmp_path: Path, payload: bytes) -> None:
    log = FrameLog.create(tmp_path / "log", META)
    with pytest.raises(ValueError, match="allowed are 1 to"):
        log.append(payload)
    log.close()


def test_an_existing_log_is_not_overwritten(tmp_path: Path) -> None:
    content = write_log(tmp_path / "log")
    with pytest.raises(FileExistsError):
        FrameLog.create(tmp_path / "log", META)
    assert (tmp_path / "log").read_bytes() == content


def test_whoever_finds_a_log_can_read_it(tmp_path: Path) -> None:
    """It is never there without its header, however often somebody looks."""
    over, seen = threading.Event(), set[Path]()

    def look() -> None:
        while not over.is_set():
            for log in tmp_path.glob("*.glvlog"):
                assert Recording.open(log).meta == {"glove": "g"}
                seen.add(log)

    with ThreadPoolExecutor(1) as pool:
        looking = pool.submit(look)
        for number in range(300):
            FrameLog.create(tmp_path / f"{number}.glvlog", {"glove": "g"}).close()
        eventually(lambda: len(seen) == 300 or looking.done(), "all are read")
        over.set()
        looking.result()
    assert sorted(tmp_path.iterdir()) == sorted(seen)


def test_header_that_is_not_json_is_damage(tmp_path: Path) -> None:
    text = b"{nonsense"
    head = b"GLVLOG1\n" + len(text).to_bytes(4, "little") + zlib.crc32(text).to_bytes(4, "little")
    (tmp_path / "log").write_bytes(head + text)
    with pytest.raises(DamagedLog, match="not JSON"):
        Recording.open(tmp_path / "log")


@contextmanager
def no_file_longer_than(size: int) -> Iterator[None]:
    """The kernel writes up to ``size`` bytes of a file and refuses the rest, as a full disk does."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("room", range(0, 76, 5))
def test_full_disk_leaves_whole_records_and_the_rest_follows_when_there_is_room(
    tmp_path: Path, room: int
) -> None:
    log = FrameLog.create(tmp_path / "log", META)
    log.append(MESSAGES[0])
    with no_file_longer_than(log.good_bytes + room):
        written = [log.append(message) for message in MESSAGES[1:4]]
        fitting = room // (8 + len(MESSAGES[0]))
        assert written == [True] * fitting + [False] * (3 - fitting)
        assert log.waiting == 3 - fitting
        problem = log.problem
        assert problem is not None
        assert "log" in problem
        assert list(Recording.open(log.path).payloads()) == MESSAGES[: 1 + fitting]
        assert log.path.stat().st_size == log.good_bytes
    assert log.append(MESSAGES[4])
    assert (log.problem, log.waiting, log.lost_records) == (None, 0, 0)
    log.close()
    assert list(Recording.open(log.path).payloads()) == MESSAGES


def test_disk_that_stays_full_costs_the_oldest_waiting_records_and_says_how_many(tmp_path: Path) -> None:
    log = FrameLog.create(tmp_path / "log", META)
    payloads = [str(number).encode() for number in range(MAX_WAITING + 10)]
    with no_file_longer_than(log.good_bytes):
        for payload in payloads:
            assert not log.append(payload)
    assert log.lost_records == 10
    log.close()
    assert log.lost_records == 10
    assert list(Recording.open(log.path).payloads()) == payloads[10:]


def test_what_still_waits_at_the_end_is_counted_as_lost(tmp_path: Path) -> None:
    log = FrameLog.create(tmp_path / "log", META)
    with no_file_longer_than(log.good_bytes):
        log.append(b"one")
        log.append(b"two")
        log.close()
    assert log.lost_records == 2
    log.close()


def test_log_without_room_for_its_header_is_not_left_behind(tmp_path: Path) -> None:
    with no_file_longer_than(20), pytest.raises(OSError, match="room"):
        FrameLog.create(tmp_path / "log", META)
    assert not (tmp_path / "log").exists()


def test_background_sync_runs_and_stops(tmp_path: Path) -> None:
    log = FrameLog.create(tmp_path / "log", META)
    log.append(MESSAGES[0])
    syncing = BackgroundSync(log, period_s=0.01)
    eventually(lambda: log._synced_bytes == log.good_bytes, "the log is synced")
    syncing.close()
    log.close()


def test_killed_writer_loses_no_appended_record(tmp_path: Path) -> None:
    writer = (
        "import os, signal, sys; from glovecal_client import FrameLog\n"
        "log = FrameLog.create(sys.argv[1], {})\n"
        "for i in range(1000): log.append(b'%d' % i)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    path = tmp_path / "log"
    assert subprocess.run([sys.executable, "-c", writer, str(path)], check=False).returncode == -9
    assert [int(payload) for payload in Recording.open(path).payloads()] == list(range(1000))
