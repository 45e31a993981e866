"""What an export format is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from glovecal_service.exports.hand_motion import Content, HandMotion


@dataclass(frozen=True)
class ExportFormat:
    """Known by the end of a file's name."""

    suffix: str
    """With its dot, lower case."""
    media_type: str
    write: Callable[[Sequence[HandMotion], Content, Path], None]
    """Writes hands on one time to a file. Raises BadInput."""
