"""The log file's bytes: a header with JSON, then records of length, CRC-32 and payload (wire/README.md)."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from glovecal_client.errors import DamagedLog
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
    while len(pair := file.read(_PAIR.size)) == _PAIR.size:
        length, crc = _PAIR.unpack(pair)
        if not 1 <= length <= MAX_RECORD_BYTES:
            return
        payload = file.read(length)
        if len(payload) != length or zlib.crc32(payload) != crc:
            return
        offset += _PAIR.size + length
        yield offset, payload


def good_end(path: Path) -> tuple[dict[str, Any], int, int]:
    """The meta, the number of good records and where they end. Raises DamagedLog for a bad header."""
    with path.open("rb") as file:
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
    with path.open("r+b") as file:
        file.seek(end)
        tail = file.read()
        if tail:
            with path.with_name(path.name + ".cut").open("ab") as kept:
                kept.write(tail)
            file.truncate(end)
    return len(tail)


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
        with path.open("rb") as file:
            meta, first = read_header(file, path.name)
        return cls(path, meta, first)

    def payloads(self) -> Iterator[bytes]:
        """The records' payloads in the order they were written."""
        with self.path.open("rb") as file:
            for _, payload in scan_records(file, self.first_record):
                yield payload

    def frames(self) -> Iterator[Frame]:
        """The frames in the order they were written. Raises WireError for a record that is no frame."""
        return map(decode_frame, self.payloads())
