"""Files that verbs write: whole or not at all, and never over another file unasked."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from glovecal_client.private_files import make_ordinary
from glovecal_service.cli.terminal.printing import out
from glovecal_service.cli.terminal.refusal import Refusal

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files that are there already.")]


def require_place(*files: Path, overwrite: bool) -> None:
    """Refuse before the work what could not be written after it."""
    for file in files:
        if not file.parent.is_dir():
            raise Refusal(f"cannot write {file}: there is no folder {file.parent}")
        if file.is_dir():
            raise Refusal(f"cannot write {file}: it is a folder; name a file")
        if file.exists() and not overwrite:
            raise Refusal(f"{file} exists already; name another file, or replace it with --overwrite")


def write_whole(contents: Mapping[Path, bytes], *, tell: Console = out) -> None:
    """Write files beside their places and move them there, so that a full disk leaves no half of one.

    It is said when all are there.
    """
    for file, content in contents.items():
        unfinished = file.with_name(f".{file.name}.{os.getpid()}.part")
        try:
            unfinished.write_bytes(content)
            make_ordinary(unfinished)
            unfinished.replace(file)
        finally:
            unfinished.unlink(missing_ok=True)
    for file in contents:
        tell.print(f"Wrote {file}.")
