"""How verbs answer: a table for people, JSON for programs, sentences on standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from textwrap import fill
from typing import Any

from rich.console import Console, RenderableType
from rich.table import Table

WIDTH_OF_A_FILE = 400
"""Columns to use where there is no terminal to fit into: lines stay whole for grep."""
LINE = 79
"""Characters of a line of a sentence beside a table."""

out = Console(highlight=False, markup=False, emoji=False, soft_wrap=True)
err = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)


def print_json(document: Any) -> None:
    """Indented JSON on standard output, nothing else."""
    sys.stdout.write(json.dumps(document, indent=2, allow_nan=False) + "\n")


def print_table(
    rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str], *, empty: str, folds: str | None = None
) -> None:
    """``columns`` maps a row's key to its heading; ``empty`` is the sentence for no rows.

    On a narrow terminal the column ``folds`` (else the last) is what wraps.
    """
    if not rows:
        out.print(empty)
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for key, heading in columns.items():
        justify = "right" if all(_is_number(row.get(key)) for row in rows) else "left"
        whole = key != (folds or list(columns)[-1])
        table.add_column(heading, justify=justify, no_wrap=whole, min_width=len(heading), overflow="fold")
    for row in rows:
        table.add_row(*(text(row.get(key)) for key in columns))
    show(table)


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
    """A value as a person reads it."""
    if value is None or value in ({}, [], ()):
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1 else f"{value:.2f}"
    if isinstance(value, list | tuple):
        return ", ".join(text(item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {text(item)}" for key, item in value.items())
    return str(value)


def moment(value: str | None) -> str | None:
    """A time stamp of the service as this computer's clock shows it, to the minute."""
    if value is None:
        return None
    return datetime.fromisoformat(value).astimezone().strftime("%Y-%m-%d %H:%M")
