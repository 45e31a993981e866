"""How verbs answer: a table for people, JSON for programs, files, sentences on standard error, an exit code.

A file is written whole or not at all, never over another unasked.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console, RenderableType
from rich.table import Table

from glovecal_client.errors import ClientError, ServiceError
from glovecal_client.operating_system import move_over
from glovecal_client.private_files import make_ordinary
from glovecal_models.errors import GlovecalError
from glovecal_service.plain import Found, read

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


WIDTH_OF_A_FILE = 400
"""Columns to use where there is no terminal to fit into: lines stay whole for grep."""
LINE = 79
"""Characters of a line of a sentence beside a table."""

out = Console(highlight=False, markup=False, emoji=False, soft_wrap=True)
err = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)


def print_json(document: Any) -> None:
    """Indented JSON on standard output, nothing else."""
    sys.stdout.write(json.dumps(document, indent=2, allow_nan=False) + "\n")


def read_or_print(kind: type[Found], document: Any, as_json: bool) -> Found:
    """What REST answered, as what it is; ``as_json`` prints it as it came, and the verb ends."""
    if as_json:
        print_json(document)
        raise typer.Exit
    return read(kind, document)


def print_table(
    rows: Sequence[object],
    columns: Mapping[str, str],
    *,
    empty: str,
    folds: str | None = None,
) -> None:
    """``columns`` maps a row's key or attribute to its heading; ``empty`` is the sentence for no rows.

    On a narrow terminal the column ``folds`` (else the last) is what wraps.
    """
    if not rows:
        out.print(empty)
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for key, heading in columns.items():
        justify = "right" if all(_is_number(_cell(row, key)) for row in rows) else "left"
        whole = key != (folds or list(columns)[-1])
        table.add_column(heading, justify=justify, no_wrap=whole, min_width=len(heading), overflow="fold")
    for row in rows:
        table.add_row(*(text(_cell(row, key)) for key in columns))
    show(table)


def _cell(row: object, key: str) -> Any:
    return row.get(key) if isinstance(row, Mapping) else getattr(row, key)


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def show(picture: RenderableType) -> None:
    """Fitted into a terminal; elsewhere as wide as it is."""
    if out.is_terminal:
        out.print(picture, soft_wrap=False)
        return
    wide = Console(width=WIDTH_OF_A_FILE, markup=False, emoji=False, highlight=False)
    with wide.capture() as captured:
        wide.print(picture)
    for line in captured.get().splitlines():
        sys.stdout.write(line.rstrip() + "\n")


def print_sentences(sentences: Iterable[str], about: str = "") -> None:
    """Each on lines of its own that are no longer than those of a table; ``about`` begins each.

    In a file each is one line, as tables are.
    """
    for sentence in sentences:
        out.print(fill(f"{about}{sentence}", LINE) if out.is_terminal else f"{about}{sentence}")


def print_facts(document: Mapping[str, Any]) -> None:
    """One line a fact, for a single thing."""
    width = max((len(key) for key in document), default=0)
    for key, value in document.items():
        out.print(f"{key:<{width}}  {text(value)}")


def text(value: Any) -> str:
    """A value as a person reads it; a time stamp as this computer's clock shows it, to the minute."""
    if value is None or value in ({}, [], ()):
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, datetime):
        return value.astimezone().strftime("%Y-%m-%d %H:%M")
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1 else f"{value:.2f}"
    if isinstance(value, list | tuple):
        return ", ".join(text(item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {text(item)}" for key, item in value.items())
    return str(value)


REFUSED, WRONG_USE, NO_SERVICE, INTERRUPTED = 1, 2, 3, 130


class Refusal(GlovecalError):
    """The command itself found what was asked for impossible."""


class NobodyThere(Refusal):
    """No service, or nothing that would answer."""

    exit_code = NO_SERVICE


def sentence_of(error: Exception) -> str:
    """For a person: without HTTP's status numbers, and with the fields the service found wrong."""
    fields = getattr(error, "problem", {}).get("errors") if isinstance(error, ServiceError) else None
    if fields:
        return "; ".join(f"{_field(item['location'])}{item['problem']}" for item in fields)
    if isinstance(error, ServiceError):
        return error.detail or error.title
    if isinstance(error, OSError):
        named = f"{error.filename}: " if error.filename else ""
        return named + (error.strerror or str(error))
    return str(error)


def exit_code_of(error: Exception) -> int:
    return getattr(error, "exit_code", REFUSED)


def _field(location: str) -> str:
    """``body.rotations.0`` is ``rotations: `` to somebody who never saw the body: the value stands behind."""
    part, *names = location.split(".")
    if part not in ("body", "query", "path", "header"):
        names = [part, *names]
    shown = ", ".join(name for name in names if not name.isdigit())
    return f"{shown}: " if shown else ""


EXPECTED = (GlovecalError, ClientError, OSError)
"""What is told in a sentence; anything else is a mistake of ours and keeps its traceback."""


Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")]

Report = Annotated[
    Path | None, typer.Option("--report", help="Write it with pictures to this .html or .pdf file.")
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


def fetch_report(service: RestClient, path: str, body: Mapping[str, Any], file: Path) -> bytes:
    """What is asked for at ``path``, as ``file`` is to hold it."""
    return service.made(f"{path}?format={_form(file)}", body)


def fetch_job_report(service: RestClient, job: str, file: Path) -> bytes:
    """Of a finished job that has one."""
    return service.download(f"/jobs/{job}/report", {"format": _form(file)})


def _form(file: Path) -> str:
    return "pdf" if file.suffix.lower() == ".pdf" else "html"


def write_report(file: Path, page: bytes, *, as_json: bool) -> None:
    """Before anything is printed, since whoever reads that may stop reading (``| head``).

    Says so where it does not get into the JSON.
    """
    write_whole({file: page}, tell=err if as_json else out)
