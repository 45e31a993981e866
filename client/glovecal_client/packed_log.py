"""A frame log that nobody writes to any more, packed to a seventh: byte for byte what it was when it is read.

    8 bytes   ``GLVPACK1``
    blocks    u32 bytes of the log, u32 CRC-32 of these, u32 bytes that follow, u32 frames in it, then what
              follows, compressed (zlib, RFC 1950)
    16 bytes  zeros: the end

Little-endian. Of a block without frames it is the log as it is. Of one with frames, all of one length, what
follows is their first bytes, then their second ones and so on, as a glove changes little from frame to frame:
numbers and times as differences to the frame before, the wall clock as its lead over the monotonic one.
Records' lengths and checksums are not among them: they follow from the frames.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from typing import Any, BinaryIO

from glovecal_client.errors import DamagedFile

MAGIC = b"GLVPACK1"
FRAMES_OF_A_BLOCK, LOOSE_BYTES = 4096, 1 << 20
MAX_BLOCK_BYTES = 1 << 26
_BLOCK, _RECORD, _CHECKSUM = struct.Struct("<IIII"), struct.Struct("<II"), struct.Struct("<I")
_TIMES = slice(8, 32)
"""Of a frame: sequence number, monotonic and wall clock (wire/README.md)."""
_SHORTEST = 48
_END = bytes(_BLOCK.size)
_LEVEL = 9


def packed_blocks(log: BinaryIO) -> Iterator[bytes]:
    """Of a whole log as it lies there, whatever is in it: the packed file. Raises OSError, DamagedFile."""
    yield MAGIC
    size = log.seek(0, os.SEEK_END)
    log.seek(0)
    loose, frames = bytearray(), list[bytes]()
    while record := _next_record(log, size):
        fits = _is_frame(record) and (not frames or len(record) == len(frames[0]))
        if frames and (not fits or len(frames) == FRAMES_OF_A_BLOCK):
            yield _frames_block(frames)
            frames = []
        is_frame = _is_frame(record)
        if loose and (is_frame or len(loose) >= LOOSE_BYTES):
            yield _one_block(bytes(loose), bytes(loose), 0)
            loose = bytearray()
        if is_frame:
            frames.append(record)
        else:
            loose += record
    if frames:
        yield _frames_block(frames)
    if loose:
        yield _one_block(bytes(loose), bytes(loose), 0)
    yield _END


def _next_record(log: BinaryIO, size: int) -> bytes:
    """A whole record; else what stands there, at most 64 kB, such as the header."""
    place = log.tell()
    head = log.read(_RECORD.size)
    length, crc = _RECORD.unpack(head) if len(head) == _RECORD.size else (0, 0)
    if 0 < length <= size - place - len(head):
        payload = log.read(min(length, LOOSE_BYTES))
        if zlib.crc32(payload) == crc and len(payload) == length:
            return head + payload
    log.seek(place)
    return log.read(1 << 16) if place else log.read(_header_bytes(log))


def _header_bytes(log: BinaryIO) -> int:
    """Of the log's header, so that its first record begins a block."""
    start = log.read(16)
    log.seek(0)
    return 16 + min(_RECORD.unpack(start[8:])[0], 1 << 20) if len(start) == 16 else 1 << 16


def _is_frame(record: bytes) -> bool:
    payload = record[_RECORD.size :]
    if len(payload) < _SHORTEST or not payload.startswith(b"GLVF"):
        return False
    return _RECORD.unpack_from(record) == (len(payload), zlib.crc32(payload)) and payload[
        -_CHECKSUM.size :
    ] == _CHECKSUM.pack(zlib.crc32(payload[: -_CHECKSUM.size]))


def _frames_block(records: list[bytes]) -> bytes:
    import numpy as np  # a verb that reads no packed log starts without it

    content = b"".join(records)
    rows = np.frombuffer(content, np.uint8).reshape(len(records), -1)
    rows = rows[:, _RECORD.size : -_CHECKSUM.size].copy()
    times = rows[:, _TIMES].copy().view("<u8")
    times[:, 2] -= times[:, 1]
    times[1:] = times[1:] - times[:-1]
    rows[:, _TIMES] = times.view(np.uint8)
    return _one_block(content, np.ascontiguousarray(rows.T).tobytes(), len(records))


def _one_block(content: bytes, packed: bytes, frames: int) -> bytes:
    compressed = zlib.compress(packed, _LEVEL)
    return _BLOCK.pack(len(content), zlib.crc32(content), len(compressed), frames) + compressed


def _unpacked(packed: bytes, frames: int) -> bytes:
    """The part of the log that a block holds. Raises ValueError, zlib.error."""
    if not frames:
        return packed
    import numpy as np

    rows = np.frombuffer(packed, np.uint8).reshape(-1, frames).T.copy()
    if rows.shape[1] < _SHORTEST - _CHECKSUM.size:
        raise ValueError("no frame is so short")
    times = rows[:, _TIMES].copy().view("<u8")
    times = np.cumsum(times, axis=0, dtype=np.uint64)
    times[:, 2] += times[:, 1]
    rows[:, _TIMES] = times.astype("<u8").view(np.uint8)
    records = []
    for row in rows:
        frame = row.tobytes()
        frame += _CHECKSUM.pack(zlib.crc32(frame))
        records += (_RECORD.pack(len(frame), zlib.crc32(frame)), frame)
    return b"".join(records)


class PackedReader(io.RawIOBase):
    """The log that a packed file holds. What is damaged raises DamagedFile when reading comes to it."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        """``file`` is closed with it."""
        self.name: str = name
        self._file = file
        self._starts, self._blocks = [0], list[tuple[int, int, int, int]]()
        """Of the log where each block begins; of each block its place, size, checksum and frames."""
        self._position, self._number, self._content = 0, -1, b""
        at = len(MAGIC)
        while len(head := self._pread(at, _BLOCK.size)) == _BLOCK.size and head != _END:
            size, crc, packed, frames = _BLOCK.unpack(head)
            self._blocks.append((at + _BLOCK.size, packed, crc, frames))
            self._starts.append(self._starts[-1] + size)
            at += _BLOCK.size + packed
        self._is_whole = head == _END and at + _BLOCK.size == file.seek(0, os.SEEK_END)

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._position

    def seek(self, offset: int, whence: int = 0, /) -> int:
        self._position = max(0, offset + (0, self._position, self._starts[-1])[whence])
        return self._position

    def readinto(self, buffer: Any, /) -> int:
        wanted = memoryview(buffer).cast("B")
        number = bisect_right(self._starts, self._position) - 1
        if number >= len(self._blocks):
            if not self._is_whole:
                raise DamagedFile(f"{self.name} is packed and damaged: its end is missing")
            return 0
        begins = self._position - self._starts[number]
        part = self._block(number)[begins : begins + len(wanted)]
        wanted[: len(part)] = part
        self._position += len(part)
        return len(part)

    def close(self) -> None:
        if not self.closed:
            self._file.close()
        super().close()

    def _block(self, number: int) -> bytes:
        if number != self._number:
            at, packed, crc, frames = self._blocks[number]
            size = self._starts[number + 1] - self._starts[number]
            try:
                unpacking = zlib.decompressobj()
                content = _unpacked(unpacking.decompress(self._pread(at, packed), MAX_BLOCK_BYTES), frames)
            except (ValueError, zlib.error):
                content = b""
            if len(content) != size or zlib.crc32(content) != crc:
                raise DamagedFile(
                    f"{self.name} is packed and damaged after byte {self._starts[number]} of its log"
                )
            self._number, self._content = number, content
        return self._content

    def _pread(self, at: int, size: int) -> bytes:
        self._file.seek(at)
        return self._file.read(size)
