"""Label images on disk: of each pixel the glove's colour, no face, and a stamp each (bytes below).

``NAME.labels``, little-endian, losslessly compressed; what was written before its writer died can be read:

    8 bytes   ``GLVLAB1`` and a line feed
    u32, u32  length and CRC-32 of the JSON text that follows: ``height``, ``width``, and whose pictures
    records   u32 length, u32 CRC-32 of the payload; payload: i64 monotonic and i64 wall clock, nanoseconds,
              then zlib of height x width bytes, rows from the top (0: background, 1 to 10: colours)

A record that is incomplete or damaged ends the file: everything from there on is left out, and said.
"""

from __future__ import annotations

import errno
import json
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from glovecal_client.encryption.kept_file import create_growing, open_kept
from glovecal_client.errors import DamagedFile, DeviceError, DeviceFinished, DeviceLost, reason_of
from glovecal_client.pictures.source import Picture
from glovecal_client.private_files import open_private

SUFFIX = ".labels"
MAGIC = b"GLVLAB1\n"
MOST_PIXELS = 1 << 24
MOST_HEADER_BYTES = 1 << 16
COMPRESSION = 1
"""zlib's quickest: 640 x 480 in about 1 ms and 4 kB; its best saves a quarter and takes ten times as long."""
_PAIR, _STAMPS = struct.Struct("<II"), struct.Struct("<qq")
_MOST_RECORD_BYTES = MOST_PIXELS + (1 << 16)
_OVER, _DAMAGED = "is over", "is damaged"


class LabelWriter:
    """Writes label images of one size; each is handed to the operating system before ``write`` returns."""

    def __init__(self, path: Path, size: tuple[int, int], facts: Mapping[str, Any]) -> None:
        """``size``: height, width. ``facts`` are kept in the header. Raises DeviceError, OSError."""
        _check_size(path, *size)
        text = json.dumps({**facts, "height": size[0], "width": size[1]}, allow_nan=False).encode()
        if path.suffix != SUFFIX or len(text) > MOST_HEADER_BYTES:
            raise DeviceError(f"label images {path} must end in {SUFFIX}, and their facts be short")
        try:
            self._file = create_growing(path, opener=open_private)
        except FileExistsError as error:
            raise DeviceError(f"{path} exists already; name a new file") from error
        self.path: Path = path
        self.size: tuple[int, int] = size
        self.pictures: int = 0
        self._append(MAGIC + _PAIR.pack(len(text), zlib.crc32(text)) + text)

    def write(self, labels: np.ndarray, monotonic_ns: int, wall_ns: int) -> None:
        """Raises DeviceError for another size, OSError on a full disk: nothing of the record stays then."""
        if labels.shape != self.size or labels.dtype != np.uint8:
            raise DeviceError(f"labels {labels.shape} {labels.dtype} do not fit a file of {self.size} uint8")
        packed = zlib.compress(labels.tobytes(), COMPRESSION)
        payload = _STAMPS.pack(monotonic_ns, wall_ns) + packed
        self._append(_PAIR.pack(len(payload), zlib.crc32(payload)) + payload)
        self.pictures += 1

    def close(self) -> None:
        self._file.close()

    def _append(self, record: bytes) -> None:
        before = self._file.tell()
        if self._file.write(record) != len(record):
            self._file.truncate(before)
            self._file.seek(before)
            raise OSError(errno.ENOSPC, f"{self.path}: no room")


class LabelFilePictures:
    """A source whose pictures are label images, (H, W) uint8."""

    def __init__(self, path: Path) -> None:
        self.name: str = f"labels:{path}"
        self._path = path
        self.simulated = False
        self.rate_hz: float = 30.0
        self._file: BinaryIO | None = None

    def open(self) -> None:
        """Raises DeviceLost for a file that is none of these."""
        self.close()
        try:
            file = open_kept(self._path)
        except OSError as error:
            raise DeviceLost(f"{self._path} cannot be read: {reason_of(error)}") from error
        try:
            self.about: dict[str, Any] = _header(file, self._path)
        except (DeviceLost, DamagedFile) as error:
            file.close()
            raise DeviceLost(reason_of(error)) from error
        self._file, self._number = file, 0
        self._size = self.about["height"], self.about["width"]
        self.simulated: bool = self.about.get("simulated") is True

    def read(self) -> Picture:
        if self._file is None:
            raise DeviceLost(f"{self.name} is not open")
        record = _record(self._file, self._size[0] * self._size[1])
        if isinstance(record, str):
            said = f"{self.name} {record} after {self._number} pictures"
            raise DeviceFinished(said, is_early=record != _OVER)
        self._number += 1
        monotonic_ns, wall_ns, labels = record
        return Picture(labels.reshape(self._size), monotonic_ns, wall_ns)

    def close(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            file.close()


def _header(file: BinaryIO, path: Path) -> dict[str, Any]:
    start = file.read(len(MAGIC) + _PAIR.size)
    if len(start) < len(MAGIC) + _PAIR.size or not start.startswith(MAGIC):
        raise DeviceLost(f"{path} holds no label images: it starts with {start[:8]!r}, not {MAGIC!r}")
    length, crc = _PAIR.unpack_from(start, len(MAGIC))
    text = file.read(length) if length <= MOST_HEADER_BYTES else b""
    try:
        about = json.loads(text) if len(text) == length and zlib.crc32(text) == crc else None
    except (ValueError, RecursionError):
        about = None
    if not isinstance(about, dict):
        raise DeviceLost(f"{path}: its header is damaged")
    _check_size(path, about.get("height"), about.get("width"))
    return about


def _check_size(path: Path, height: object, width: object) -> None:
    for side in (height, width):
        if not isinstance(side, int) or isinstance(side, bool) or not 1 <= side <= MOST_PIXELS:
            raise DeviceLost(f"{path}: pictures of {height!r} x {width!r}; sides are whole numbers above 0")
    if height * width > MOST_PIXELS:  # type: ignore[operator]
        raise DeviceLost(f"{path}: pictures of {height} x {width}; at most {MOST_PIXELS} pixels are read")


def read_label_times(path: Path) -> list[tuple[int, int]]:
    """Monotonic and wall time of each picture that is whole, nanoseconds. Raises DeviceLost."""
    source = LabelFilePictures(path)
    source.open()
    found = []
    try:
        assert source._file is not None
        while isinstance(payload := _payload(source._file), bytes):
            found.append(_STAMPS.unpack_from(payload))
    finally:
        source.close()
    return found


def _record(file: BinaryIO, pixels: int) -> tuple[int, int, np.ndarray] | str:
    """Stamps and labels, or in words why there is no more."""
    payload = _payload(file)
    if isinstance(payload, str):
        return payload
    unpack = zlib.decompressobj()
    try:
        labels = unpack.decompress(payload[_STAMPS.size :], pixels + 1)
    except zlib.error:
        return _DAMAGED
    if len(labels) != pixels:
        return _DAMAGED
    return *_STAMPS.unpack_from(payload), np.frombuffer(labels, np.uint8)


def _payload(file: BinaryIO) -> bytes | str:
    try:
        return _read_payload(file)
    except DamagedFile:
        return _DAMAGED


def _read_payload(file: BinaryIO) -> bytes | str:
    pair = file.read(_PAIR.size)
    if not pair:
        return _OVER
    cut = "ends in the middle of a picture"
    if len(pair) < _PAIR.size:
        return cut
    length, crc = _PAIR.unpack(pair)
    if not _STAMPS.size < length <= _MOST_RECORD_BYTES:
        return _DAMAGED
    payload = file.read(length)
    if len(payload) < length:
        return cut
    return payload if zlib.crc32(payload) == crc else _DAMAGED
