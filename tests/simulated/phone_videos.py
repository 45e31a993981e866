"""Videos as phones write them: OpenCV's, whose boxes then say variable times and how the phone was held."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

_NESTED = (b"moov", b"trak", b"mdia", b"minf", b"stbl")
_TURNS = {0: (1, 0, 0, 1), 90: (0, 1, -1, 0), 180: (-1, 0, 0, -1), 270: (0, -1, 1, 0)}
"""The upper left part of the matrix that a player turns the picture with."""


def phone_video(
    path: Path, pictures: Sequence[np.ndarray], durations_ms: Sequence[int], *, turned_deg: int = 0
) -> None:
    """``path`` ends in .mp4 or .mov; pictures (H, W, 3) as the sensor has them, each shown for its duration;
    players turn them by ``turned_deg`` with the clock."""
    import cv2

    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(
        str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (width, height)
    )
    for picture in pictures:
        writer.write(picture)
    writer.release()
    content = path.read_bytes()
    path.write_bytes(_rewritten(content, 0, len(content), list(durations_ms), turned_deg))


def _boxes(content: bytes, start: int, end: int) -> Iterator[tuple[int, int, bytes]]:
    while start < end:
        size, kind = struct.unpack_from(">I4s", content, start)
        yield start, size, kind
        start += size


def _rewritten(content: bytes, start: int, end: int, durations_ms: list[int], turned_deg: int) -> bytes:
    """The boxes there; what is filmed comes before them in the file and stays where it is."""
    found = b""
    for at, size, kind in _boxes(content, start, end):
        body, total = content[at + 8 : at + size], sum(durations_ms)
        if kind in _NESTED:
            body = _rewritten(content, at + 8, at + size, durations_ms, turned_deg)
        elif kind == b"edts":
            continue  # of the old times
        elif kind in (b"mdhd", b"mvhd"):
            body = body[:12] + struct.pack(">II", 1000, total) + body[20:]
        elif kind == b"stts":
            each = b"".join(struct.pack(">II", 1, duration) for duration in durations_ms)
            body = struct.pack(">II", 0, len(durations_ms)) + each
        elif kind == b"tkhd":
            a, b, c, d = (value << 16 for value in _TURNS[turned_deg])
            matrix = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
            body = body[:20] + struct.pack(">I", total) + body[24:40] + matrix + body[76:]
        found += struct.pack(">I4s", len(body) + 8, kind) + body
    return found
