"""The motion files that are read as a reference: how each is recognised, and its places."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from glovecal_service.exports.body_markers import BodyMarkers, read_trc
from glovecal_service.exports.motion_files.bvh_places import read_bvh

MARKED_WITHIN = 100


@dataclass(frozen=True)
class MotionFormat:
    title: str
    mark: re.Pattern[bytes]
    """How such a file begins."""
    read: Callable[[Path, str], BodyMarkers]
    """Of a file and what the user calls it. Raises BadInput."""


FORMATS = (
    MotionFormat("TRC (markers)", re.compile(rb"\A(\xef\xbb\xbf)?\s*PathFileType\b"), read_trc),
    MotionFormat("BVH (skeleton)", re.compile(rb"\A(\xef\xbb\xbf)?\s*HIERARCHY\b"), read_bvh),
)


def recognised(start: bytes) -> MotionFormat | None:
    """By how the file begins; None for what is no motion file."""
    return next((one for one in FORMATS if one.mark.search(start[:MARKED_WITHIN])), None)


def motion_format(path: Path) -> MotionFormat | None:
    """Of a file."""
    with path.open("rb") as stream:
        return recognised(stream.read(MARKED_WITHIN))
