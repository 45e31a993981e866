"""An append-only log of frames that survives kill -9, power cuts and a full disk.

A header with JSON, then records of length, CRC-32 and payload (wire/README.md). Appending is one unbuffered
write, so the record is with the operating system before the frame is published; ``BackgroundSync`` brings it
to the disk once a second. A record that could not be written whole is cut off again at once and kept in
memory, in order, until there is room.
"""

from __future__ import annotations

import errno
import json
import os
import struct
import threading
import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from glovecal_client.encryption.kept_file import (
    GrowingFile,
    create_growing,
    cut_file,
    open_kept,
    resume_growing,
)
from glovecal_client.errors import DamagedFile, DamagedLog, reason_of
from glovecal_client.operating_system import move_over, remove, sync_file
from glovecal_client.private_files import open_private
from glovecal_client.wire.frame import Frame, decode_frame

MAGIC = b"GLVLOG1\n"
MAX_RECORD_BYTES = 65536
MAX_META_BYTES = 1 << 20
_PAIR = struct.Struct("<II")


def header_bytes(meta: Mapping[str, Any]) -> bytes:
    """Magic, length, CRC and the meta as JSON. Raises ValueError for NaN or what JSON cannot hold."""
    text = json.dumps(meta, allow_nan=False).encode()
    if len(text) > MAX_META_BYTES:
        raise ValueError(f"log: meta of {len(text)} bytes; at most {MAX_META_BYTES} are allowed")
    return MAGIC + _PAIR.pack(len(text), zlib.crc32(text)) + text


def record_bytes(payload: bytes) -> bytes:
    """One record. Raises ValueError for an empty or oversized payload."""
    if not 1 <= len(payload) <= MAX_RECORD_BYTES:
        raise ValueError(f"log: record of {len(payload)} bytes; allowed are 1 to {MAX_RECORD_BYTES}")
    return _PAIR.pack(len(payload), zlib.crc32(payload)) + payload


def read_header(file: BinaryIO, name: str) -> tuple[dict[str, Any], int]:
    """The meta and the offset of the first record. Raises DamagedLog."""
    try:
        return _read_header(file, name)
    except DamagedFile as error:
        raise DamagedLog(str(error)) from error


def _read_header(file: BinaryIO, name: str) -> tuple[dict[str, Any], int]:
    file.seek(0)
    start = file.read(len(MAGIC) + _PAIR.size)
    if len(start) < len(MAGIC) + _PAIR.size or not start.startswith(MAGIC):
        raise DamagedLog(f"{name}: not a frame log, it starts with {start[:8]!r} instead of {MAGIC!r}")
    length, crc = _PAIR.unpack_from(start, len(MAGIC))
    text = file.read(length) if length <= MAX_META_BYTES else b""
    if len(text) != length or zlib.crc32(text) != crc:
        raise DamagedLog(f"{name}: its header is damaged (length {length}, CRC {crc:08x} stated)")
    try:
        meta = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DamagedLog(f"{name}: its header is not JSON: the file was damaged") from error
    if not isinstance(meta, dict):
        raise DamagedLog(f"{name}: its header holds {type(meta).__name__}, not a JSON object")
    return meta, len(start) + length


def scan_records(file: BinaryIO, offset: int) -> Iterator[tuple[int, bytes]]:
    """Yield (offset of the record's end, payload) from ``offset`` to the first bad or incomplete record.

    A length of 0 counts as bad: a power cut can leave zeros, and zero bytes have CRC 0.
    """
    file.seek(offset)
    with suppress(DamagedFile):
        while len(pair := file.read(_PAIR.size)) == _PAIR.size:
            length, crc = _PAIR.unpack(pair)
            if not 1 <= length <= MAX_RECORD_BYTES:
                return
            payload = file.read(length)
            if len(payload) != length or zlib.crc32(payload) != crc:
                return
            offset += _PAIR.size + length
            yield offset, payload


def _open(path: Path) -> BinaryIO:
    try:
        return open_kept(path)
    except DamagedFile as error:
        raise DamagedLog(str(error)) from error


def good_end(path: Path) -> tuple[dict[str, Any], int, int]:
    """The meta, the number of good records and where they end. Raises DamagedLog for a bad header."""
    with _open(path) as file:
        meta, end = read_header(file, path.name)
        records = 0
        for after, _ in scan_records(file, end):
            end = after
            records += 1
    return meta, records, end


def cut_damaged_tail(path: Path) -> int:
    """Cut the file back to its last good record and return how many bytes went.

    They are kept beside it in ``NAME.cut``: a recording is never thrown away. Raises DamagedLog, OSError.
    """
    _, _, end = good_end(path)
    return cut_file(path, end)


@dataclass(frozen=True)
class Recording:
    """A log file opened for reading; good records only."""

    path: Path
    meta: dict[str, Any]
    first_record: int

    @classmethod
    def open(cls, path: Path | str) -> Recording:
        """Raises DamagedLog if the header is not that of a log, OSError if it cannot be read."""
        path = Path(path)
        with _open(path) as file:
            meta, first = read_header(file, path.name)
        return cls(path, meta, first)

    def payloads(self) -> Iterator[bytes]:
        """The records' payloads in the order they were written."""
        with open_kept(self.path) as file:
            for _, payload in scan_records(file, self.first_record):
                yield payload

    def places(self) -> Iterator[tuple[int, bytes]]:
        """Where in the file each payload begins, and the payload."""
        with open_kept(self.path) as file:
            for end, payload in scan_records(file, self.first_record):
                yield end - len(payload), payload

    def frames(self) -> Iterator[Frame]:
        """The frames in the order they were written. Raises WireError for a record that is no frame."""
        return map(decode_frame, self.payloads())


MAX_WAITING = 7200
"""Records kept in memory while the disk is full: one minute at 120 Hz."""


class FrameLog:
    """One log file open for appending. ``append`` is for one thread; ``sync`` may run in another."""

    def __init__(self, path: Path, file: GrowingFile, meta: dict[str, Any], records: int, end: int) -> None:
        self.path = path
        self.meta = meta
        self.records: int = records
        """Records in the file."""
        self.good_bytes: int = end
        """Where the last whole record ends."""
        self.lost_records: int = 0
        """Records given up because the disk stayed full for too long."""
        self._file = file
        self._waiting: deque[bytes] = deque()
        self._append_problem: str | None = None
        self._sync_problem: str | None = None
        self._synced_bytes = self._file_bytes = end

    @classmethod
    def create(cls, path: Path | str, meta: Mapping[str, Any]) -> FrameLog:
        """A new log. Raises FileExistsError, OSError (no folder, disk full), ValueError (meta is no JSON).

        It has its header before it has its name: whoever finds it can read it.
        """
        path = Path(path)
        head = header_bytes(meta)
        if path.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
        unnamed = path.with_name(f"{path.name}.new")
        try:
            with create_growing(unnamed, "wb", open_private) as file:
                if file.write(head) != len(head):
                    raise OSError(errno.ENOSPC, f"{path}: no room for the header")
                sync_file(file)
            move_over(unnamed, path)
        except OSError:
            remove(unnamed)
            raise
        return cls(path, resume_growing(path, len(head)), dict(meta), 0, len(head))

    @classmethod
    def resume(cls, path: Path | str) -> FrameLog:
        """An existing log, cut back to its last good record. Raises DamagedLog, OSError."""
        path = Path(path)
        cut_damaged_tail(path)
        meta, records, end = good_end(path)
        return cls(path, resume_growing(path, end), meta, records, end)

    @property
    def waiting(self) -> int:
        """Records in memory that the disk did not take yet."""
        return len(self._waiting)

    @property
    def file_bytes(self) -> int:
        """What the file takes on the disk; more than ``good_bytes`` where it is encrypted."""
        if not self._file.closed:
            self._file_bytes = os.fstat(self._file.fileno()).st_size
        return self._file_bytes

    @property
    def problem(self) -> str | None:
        """Why records do not reach the disk, None if they do."""
        return self._append_problem or self._sync_problem

    def append(self, payload: bytes) -> bool:
        """Write one record; False if it has to wait in memory. Raises ValueError for a bad payload."""
        self._waiting.append(record_bytes(payload))
        written = self._write_waiting()
        while len(self._waiting) > MAX_WAITING:
            self._waiting.popleft()
            self.lost_records += 1
        return written

    def _write_waiting(self) -> bool:
        try:
            while self._waiting:
                self._write(self._waiting[0])
                self._waiting.popleft()
        except OSError as error:
            self._append_problem = f"{self.path}: {reason_of(error)}"
            return False
        self._append_problem = None
        return True

    def _write(self, record: bytes) -> None:
        if self._file.tell() != self.good_bytes:
            self._cut_back()
        written = self._file.write(record)
        if written != len(record):
            self._cut_back()
            raise OSError(errno.ENOSPC, f"no room: {written} of {len(record)} bytes written")
        self.good_bytes += len(record)
        self.records += 1

    def _cut_back(self) -> None:
        self._file.truncate(self.good_bytes)
        self._file.seek(self.good_bytes)

    def sync(self) -> None:
        """Bring what was written to the disk; a failure shows in ``problem``."""
        end = self.good_bytes
        if end == self._synced_bytes and self._sync_problem is None:
            return
        try:
            sync_file(self._file)
        except OSError as error:
            self._sync_problem = f"{self.path}: {reason_of(error)}"
        else:
            self._sync_problem = None
            self._synced_bytes = end

    def close(self) -> None:
        """Write what is waiting, sync and close; harmless when already closed."""
        if not self._file.closed:
            self._write_waiting()
            self.lost_records += len(self._waiting)
            self._waiting.clear()
            self.sync()
            self._file_bytes = self.file_bytes
            self._file.close()


class BackgroundSync:
    """Syncs a log once a second in a thread of its own; close it before the log."""

    def __init__(self, log: FrameLog, period_s: float = 1.0) -> None:
        self._log = log
        self._period_s = period_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="log sync", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(self._period_s):
            self._log.sync()

    def close(self) -> None:
        """Stop the thread."""
        self._stop.set()
        self._thread.join()
