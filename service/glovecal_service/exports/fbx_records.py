"""The binary form of FBX 7: records of a name, values and further records, written and read.

What a record takes is known when it is whole: then its head is written again. What a file claims is believed
within its own size only, and nothing is kept of what is not asked for.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from mmap import mmap
from typing import BinaryIO

import numpy as np

from glovecal_models.errors import BadInput

HEAD = b"Kaydara FBX Binary  \x00\x1a\x00"
TEXT_HEAD = b"; FBX"
VERSION = 7400
WIDE_FROM = 7500
"""Before, heads of records are of 32 bits, and a file of 4 GB at most."""
VERSIONS = (7400, 7700)
DEEPEST = 64
MOST_NUMBERS = 4096
"""Of an array that is read; others are copied as they are."""
COPIED_BYTES = 1 << 20
"""At once."""
RIGHT = "Export the character again as binary FBX 7.4"
FOOTER_ID = bytes.fromhex("fabcab09d0c8d466b176fb831cf7267e")
FOOTER_END = bytes.fromhex("f85a8c6adef5d97eece90ce3758f290b")
CREATED = "1970-01-01 10:00:00:000"
FILE_ID = bytes.fromhex("28b32aebb624ccc2bfc8b02aa92bfcf1")
"""The time and the three marks belong together: readers check the marks against the time."""
_FIRST = len(HEAD) + 4
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


@dataclass(frozen=True)
class Form:
    """Of a version."""

    version: int

    @property
    def numbers(self) -> struct.Struct:
        """A record's end, and how many values and bytes of them it has."""
        return struct.Struct("<QQQ" if self.version >= WIDE_FROM else "<III")

    @property
    def no_record(self) -> bytes:
        """Ends a list of records."""
        return bytes(self.numbers.size + 1)


class Records:
    """Writes records to a stream."""

    def __init__(self, stream: BinaryIO, version: int = VERSION) -> None:
        self.stream = stream
        self.form = Form(version)

    def begin_file(self) -> None:
        self.stream.write(HEAD + struct.pack("<I", self.form.version))

    def end_file(self, id: bytes = FOOTER_ID) -> None:
        """``id``: of the file's time."""
        self.stream.write(self.form.no_record + id + bytes(4))
        padding = bytes(-self.stream.tell() % 16 or 16)
        self.stream.write(padding + struct.pack("<I", self.form.version) + bytes(120) + FOOTER_END)

    @contextmanager
    def record(self, name: str, *values: Value) -> Iterator[None]:
        """A record of other records."""
        encoded = b"".join(map(_encoded, values))
        with self.raw(name.encode("ascii"), len(values), len(encoded), [encoded]):
            yield
            self.stream.write(self.form.no_record)

    def leaf(self, name: str, *values: Value) -> None:
        """A record of values only."""
        encoded = b"".join(map(_encoded, values))
        with self.raw(name.encode("ascii"), len(values), len(encoded), [encoded]):
            pass

    @contextmanager
    def raw(self, name: bytes, count: int, length: int, values: Iterable[bytes]) -> Iterator[None]:
        """A record of ``count`` values in ``length`` bytes; what ends its list is the caller's."""
        begin, numbers = self.stream.tell(), self.form.numbers
        self.stream.write(numbers.pack(0, count, length) + bytes([len(name)]) + name)
        self.stream.writelines(values)
        yield
        end = self.stream.tell()
        self.stream.seek(begin)
        self.stream.write(numbers.pack(end, count, length))
        self.stream.seek(end)

    @contextmanager
    def object(self, kind: str, id: np.int64, name: str, subtype: str = "") -> Iterator[None]:
        """A record that others are connected with."""
        kind_of_name = kind.replace("Animation", "Anim")
        with self.record(kind, id, f"{name}{BETWEEN_NAME_AND_KIND}{kind_of_name}", subtype):
            yield

    def properties(self, *rows: tuple[str | Value, ...]) -> None:
        """Each: name, type, label, flags and values."""
        with self.record("Properties70"):
            for row in rows:
                self.leaf("P", *row)

    def connect(self, child: np.int64, parent: np.int64, *place: str) -> None:
        """``place``: the property of the parent that the child gives; none: it hangs on it."""
        self.leaf("C", "OP" if place else "OO", child, parent, *place)


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


@dataclass(frozen=True)
class Record:
    """Of a file that is read: where its parts are."""

    name: bytes
    count: int
    """Of its values."""
    values: int
    """Where they begin."""
    inside: int
    """Where its records begin."""
    end: int
    depth: int


_SCALARS = {
    b"Y": struct.Struct("<h"), b"C": struct.Struct("<?"), b"I": struct.Struct("<i"),
    b"F": struct.Struct("<f"), b"D": struct.Struct("<d"), b"L": struct.Struct("<q"),
}  # fmt: skip
_LENGTH, _ARRAY = struct.Struct("<I"), struct.Struct("<III")
_ARRAYS = {b"f": "<f4", b"d": "<f8", b"l": "<i8", b"i": "<i4", b"b": "u1", b"c": "u1"}
ReadValue = bool | int | float | bytes | np.ndarray


class RecordFile:
    """A file's records; text is bytes."""

    def __init__(self, content: bytes | mmap, name: str) -> None:
        """Raises BadInput that names ``name`` and what is wrong with it."""
        self.content, self.name = content, name
        if content[: len(HEAD)] != HEAD or len(content) < _FIRST:
            is_text = content[: len(TEXT_HEAD)] == TEXT_HEAD
            why = "is FBX as text (ASCII)" if is_text else "does not begin as binary FBX does"
            raise BadInput(f"{name} {why}. {RIGHT}")
        (self.version,) = _LENGTH.unpack_from(content, len(HEAD))
        if not VERSIONS[0] <= self.version <= VERSIONS[1]:
            raise BadInput(f"{name} is FBX {self.version / 1000:g}; 7.4 to 7.7 are read. {RIGHT}")
        self._form = Form(self.version)

    def records(self, above: Record | None = None) -> Iterator[Record]:
        """Inside of one, or the file's own. Raises BadInput where they are not as they say."""
        at, limit, depth = _FIRST, len(self.content), 0
        if above is not None:
            at, limit, depth = above.inside, above.end, above.depth + 1
        if depth > DEEPEST:
            raise self._damaged(at, f"it has records more than {DEEPEST} deep")
        while at < limit and self._part(at, len(self._form.no_record), limit) != self._form.no_record:
            record = self._record(at, limit, depth)
            yield record
            at = record.end

    def values(self, record: Record) -> Iterator[ReadValue]:
        """One after another. Raises BadInput where they are not as they say."""
        at, limit = record.values, record.inside
        for _ in range(record.count):
            kind = self._part(at, 1, limit)
            at += 1
            if kind in _SCALARS:
                form = _SCALARS[kind]
                yield form.unpack(self._part(at, form.size, limit))[0]
                at += form.size
            elif kind in (b"S", b"R"):
                (length,) = _LENGTH.unpack(self._part(at, _LENGTH.size, limit))
                yield self._part(at + _LENGTH.size, length, limit)
                at += _LENGTH.size + length
            elif kind in _ARRAYS:
                count, is_packed, length = _ARRAY.unpack(self._part(at, _ARRAY.size, limit))
                at += _ARRAY.size
                yield self._array(np.dtype(_ARRAYS[kind]), count, bool(is_packed), at, length, limit)
                at += length
            else:
                raise self._damaged(at, f"it has a value of the unknown kind {kind!r}")

    @contextmanager
    def copied(
        self, record: Record, records: Records, instead: Callable[[Record], bool] = lambda _: False
    ) -> Iterator[None]:
        """A record with all that it holds; more can be written into it. ``instead``: writes another for
        one of its records, and says whether it did."""
        with self._copied_values(record, records):
            for one in self.records(record):
                if not instead(one):
                    self.copy(one, records)
            yield
            records.stream.write(records.form.no_record)

    def copy(self, record: Record, records: Records) -> None:
        has_records = record.inside < record.end
        with self.copied(record, records) if has_records else self._copied_values(record, records):
            pass

    @property
    def footer_id(self) -> bytes:
        """That readers check against the file's time."""
        end = _FIRST
        for record in self.records():
            end = record.end
        end += len(self._form.no_record)
        id = self.content[end : end + len(FOOTER_ID)]
        return id if len(id) == len(FOOTER_ID) else FOOTER_ID

    def _copied_values(self, record: Record, records: Records) -> AbstractContextManager[None]:
        starts = range(record.values, record.inside, COPIED_BYTES)
        parts = (self.content[at : min(at + COPIED_BYTES, record.inside)] for at in starts)
        return records.raw(record.name, record.count, record.inside - record.values, parts)

    def _record(self, at: int, limit: int, depth: int) -> Record:
        numbers = self._form.numbers
        end, count, length = numbers.unpack(self._part(at, numbers.size, limit))
        named = at + numbers.size + 1
        values = named + self._part(named - 1, 1, limit)[0]
        if not values + length <= end <= limit:
            raise self._damaged(at, f"a record says that it ends at byte {end}, which cannot be")
        return Record(self._part(named, values - named, limit), count, values, values + length, end, depth)

    def _array(
        self, kind: np.dtype, count: int, is_packed: bool, at: int, length: int, limit: int
    ) -> np.ndarray:
        size = count * kind.itemsize
        if count > MOST_NUMBERS:
            raise self._damaged(at, f"it has {count} numbers where at most {MOST_NUMBERS} are expected")
        content = self._part(at, length, limit)
        if is_packed:
            try:
                content = zlib.decompressobj().decompress(content, size + 1)
            except zlib.error as error:
                raise self._damaged(at, "numbers cannot be unpacked") from error
        if len(content) != size:
            raise self._damaged(at, f"{count} numbers take {size} bytes, but {len(content)} are there")
        return np.frombuffer(content, kind)

    def _part(self, at: int, length: int, limit: int) -> bytes:
        if at + length > limit:
            raise self._damaged(at, f"{length} bytes are missing")
        return self.content[at : at + length]

    def _damaged(self, at: int, what: str) -> BadInput:
        return BadInput(f"{self.name} is damaged at byte {at}: {what}. {RIGHT}")
