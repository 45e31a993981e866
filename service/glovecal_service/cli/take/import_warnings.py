"""What an import warns of, over all its files: like sentences of several files are one line with a count."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from glovecal_models.improvement.take_warnings import kind_of
from glovecal_service.cli.terminal.printing import err


class ImportWarnings:
    def __init__(self) -> None:
        self._alike: dict[str, list[str]] = {}

    def add(self, file: Path, sentences: Iterable[str]) -> None:
        for sentence in sentences:
            self._alike.setdefault(kind_of(sentence), []).append(f"{file}: {sentence}")

    def print(self) -> None:
        """On standard error: the first of each kind, and how many more files have it."""
        for first, *more in self._alike.values():
            files = "file" if len(more) == 1 else "files"
            err.print(f"{first} The same in {len(more)} more {files}." if more else first, style="yellow")
