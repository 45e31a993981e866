"""Files that verbs write: whole or not at all, never over another unasked; pages with pictures too."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from glovecal_client.operating_system import move_over
from glovecal_client.private_files import make_ordinary
from glovecal_service.cli.terminal.printing import err, out
from glovecal_service.cli.terminal.refusal import Refusal

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")]

Report = Annotated[
    Path | None, typer.Option("--report", help="Write a page with pictures to this .html file.")
]


def require_place(*files: Path, overwrite: bool) -> None:
    """Refuse before the work what could not be written after it."""
    for file in files:
        if not file.parent.is_dir():
            raise Refusal(f"cannot write {file}: there is no folder {file.parent}")
        if file.is_dir():
            raise Refusal(f"cannot write {file}: it is a folder; give a file name")
        if file.exists() and not overwrite:
            raise Refusal(f"{file} exists already; give another name, or replace it with --overwrite")


def write_whole(contents: Mapping[Path, bytes], *, tell: Console = out) -> None:
    """Write files beside their places and move them there, so that a full disk leaves no half of one.

    It is said when all are there.
    """
    for file, content in contents.items():
        unfinished = file.with_name(f".{file.name}.{os.getpid()}.part")
        try:
            unfinished.write_bytes(content)
            make_ordinary(unfinished)
            move_over(unfinished, file)
        finally:
            unfinished.unlink(missing_ok=True)
    for file in contents:
        tell.print(f"Wrote {file}.")


def fetch_report(service: RestClient, models: Sequence[str], takes: Sequence[dict[str, Any]]) -> bytes:
    """The first of ``models`` looked at closely, the others beside it, against rows of ``GET /takes``."""
    body = {"takes": [row["id"] for row in takes], "beside": list(models[1:])}
    return service.page(f"/models/{models[0]}/report", body).encode()


def fetch_job_report(service: RestClient, job: str) -> bytes:
    """The page of a finished job that has one."""
    return service.download(f"/jobs/{job}/report")


def write_report(file: Path, page: bytes, *, as_json: bool) -> None:
    """Before anything is printed, since whoever reads that may stop reading (``| head``).

    Says so where it does not get into the JSON.
    """
    write_whole({file: page}, tell=err if as_json else out)
