"""Takes in two files: the reference table X.reference.csv beside X.frames.csv."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def reference_beside(frames: Path) -> Path | None:
    """X.reference.csv for X.frames.csv, when it is there."""
    stem, mark, rest = frames.name.rpartition(".frames.")
    partner = frames.with_name(f"{stem}.reference.{rest}")
    return partner if mark and partner.is_file() else None


def frames_among(files: Sequence[Path]) -> list[Path]:
    """``files`` without those that are the reference table of another one."""
    return [
        file
        for file in dict.fromkeys(files)
        if not any(reference_beside(other) == file for other in files if other != file)
    ]
