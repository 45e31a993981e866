"""The binary form of FBX 7: records of a name, properties and further records, written one after another.

What a record takes is known when it is whole: then its head is written again.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

HEAD = b"Kaydara FBX Binary  \x00\x1a\x00"
VERSION = 7400
FOOTER_ID = bytes.fromhex("fabcab09d0c8d466b176fb831cf7267e")
FOOTER_END = bytes.fromhex("f85a8c6adef5d97eece90ce3758f290b")
CREATED = "1970-01-01 10:00:00:000"
FILE_ID = bytes.fromhex("28b32aebb624ccc2bfc8b02aa92bfcf1")
"""The time and the three marks belong together: readers check the marks against the time."""
BETWEEN_NAME_AND_KIND = "\x00\x01"


@dataclass(frozen=True)
class Compressed:
    """An array of int64 that many curves share, compressed once."""

    count: int
    content: bytes

    @classmethod
    def of(cls, values: np.ndarray) -> Compressed:
        return cls(len(values), zlib.compress(values.astype("<i8").tobytes(), 1))


Value = bool | int | np.int64 | float | str | bytes | np.ndarray | Compressed
"""``int`` is written in 32 bits, ``np.int64`` in 64."""


class Records:
    """Writes records to a stream."""

    def __init__(self, stream: BinaryIO) -> None:
        self.stream = stream

    def begin_file(self) -> None:
        self.stream.write(HEAD + struct.pack("<I", VERSION))

    def end_file(self) -> None:
        self.stream.write(_NO_RECORD + FOOTER_ID + bytes(4))
        padding = bytes(-self.stream.tell() % 16 or 16)
        self.stream.write(padding + struct.pack("<I", VERSION) + bytes(120) + FOOTER_END)

    @contextmanager
    def record(self, name: str, *values: Value) -> Iterator[None]:
        """A record of other records."""
        begin = self._begin(name, values)
        yield
        self.stream.write(_NO_RECORD)
        self._end(begin)

    def leaf(self, name: str, *values: Value) -> None:
        """A record of values only."""
        self._end(self._begin(name, values))

    def _begin(self, name: str, values: Sequence[Value]) -> int:
        begin, text = self.stream.tell(), b"".join(map(_encoded, values))
        self.stream.write(struct.pack("<III", 0, len(values), len(text)) + bytes([len(name)]))
        self.stream.write(name.encode("ascii") + text)
        return begin

    def _end(self, begin: int) -> None:
        end = self.stream.tell()
        self.stream.seek(begin)
        self.stream.write(struct.pack("<I", end))
        self.stream.seek(end)

    @contextmanager
    def object(self, kind: str, id: np.int64, name: str, said: str = "") -> Iterator[None]:
        """A record that others are connected with."""
        kind_of_name = kind.replace("Animation", "Anim")
        with self.record(kind, id, f"{name}{BETWEEN_NAME_AND_KIND}{kind_of_name}", said):
            yield

    def properties(self, *rows: tuple[str | Value, ...]) -> None:
        """Each: name, type, label, flags and values."""
        with self.record("Properties70"):
            for row in rows:
                self.leaf("P", *row)

    def connect(self, child: np.int64, parent: np.int64, *place: str) -> None:
        """``place``: the property of the parent that the child gives; none: it hangs on it."""
        self.leaf("C", "OP" if place else "OO", child, parent, *place)


_NO_RECORD = bytes(13)


def _encoded(value: Value) -> bytes:
    match value:
        case bool():
            return b"C" + bytes([value])
        case int():
            return struct.pack("<ci", b"I", value)
        case float():
            return struct.pack("<cd", b"D", value)
        case bytes():
            return struct.pack("<cI", b"R", len(value)) + value
        case str():
            return struct.pack("<cI", b"S", len(value.encode())) + value.encode()
        case Compressed():
            return struct.pack("<cIII", b"l", value.count, 1, len(value.content)) + value.content
    if value.ndim == 0:
        return struct.pack("<cq", b"L", int(value))
    kind = {"f4": b"f", "f8": b"d", "i4": b"i"}[value.dtype.str[1:]]
    return struct.pack("<cIII", kind, value.size, 0, value.nbytes) + value.tobytes()
