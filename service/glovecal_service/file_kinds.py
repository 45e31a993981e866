"""What a file is, by what it holds: its name says little, and is often wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from glovecal_client.capture.cyberglove3.card import card_layout
from glovecal_client.encryption.kept_file import open_kept

FileKind = Literal["model", "calibration", "motion", "card", "video", "table"]
LOOKED_AT = 65536
"""Bytes from the beginning: a card writes its first record within some hundred."""


def kind_of(path: Path) -> FileKind:
    """A table where nothing else is recognised: whoever reads it says what is wrong."""
    with open_kept(path) as stream:
        start = stream.read(LOOKED_AT)
    for kind, is_one in _KINDS.items():
        if is_one(start):
            return kind
    return "table"


def _is_model(start: bytes) -> bool:
    """A safetensors file: the length of a JSON header, 64 bits, and the header."""
    return start[8:10] == b'{"' and b"\0" in start[:8]


def _is_calibration(start: bytes) -> bool:
    from glovecal_service.exports.vendor_calibrations import (
        formats,  # slow to load, and lists of takes load this
    )

    return formats.recognised(formats.as_text(start)) is not None


def _is_motion(start: bytes) -> bool:
    from glovecal_service.exports.motion_files import formats  # as above

    return formats.recognised(start) is not None


def _is_card(start: bytes) -> bool:
    return b"\0" in start and card_layout(start) is not None


def _is_video(start: bytes) -> bool:
    """MP4 and QuickTime, Matroska and WebM, AVI."""
    is_boxes = start[4:8] in (b"ftyp", b"moov", b"mdat", b"wide") and b"\0" in start[:4]
    return is_boxes or start[:4] == b"\x1aE\xdf\xa3" or (start[:4] == b"RIFF" and start[8:12] == b"AVI ")


_KINDS: dict[FileKind, Callable[[bytes], bool]] = {
    "model": _is_model,
    "calibration": _is_calibration,
    "motion": _is_motion,
    "card": _is_card,
    "video": _is_video,
}
