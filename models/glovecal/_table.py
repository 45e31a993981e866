"""A table of results: one description, from which text, HTML and a pandas frame follow."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from glovecal_models.installation import not_installed

Cell = str | int | float | bool | None
MOST_ROWS, MOST_COLUMNS = 60, 12
"""What is printed; a frame holds everything."""
ENDS = 5
GAP = "..."


@dataclass(frozen=True)
class Column:
    """One column; the unit is the end of its name, such as ``rmse_deg``."""

    name: str
    digits: int = 2
    """Decimals of its numbers when they are printed."""


@dataclass(frozen=True)
class Table:
    """Rows under named columns, with sentences before and after them."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        columns: Sequence[Column],
        rows: Sequence[Sequence[Cell]],
        *,
        before: Sequence[str] = (),
        after: Sequence[str] = (),
    ) -> Table:
        return cls(tuple(columns), tuple(tuple(row) for row in rows), tuple(before), tuple(after))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(column.name for column in self.columns)

    def to_text(self) -> str:
        """For a terminal: numbers to the right, text to the left."""
        header, cells, is_text = self._printed()
        widths = [max(map(len, column)) for column in zip(header, *cells, strict=True)]

        def line(row: Sequence[str]) -> str:
            placed = zip(row, widths, is_text, strict=True)
            return "  ".join(c.ljust(w) if left else c.rjust(w) for c, w, left in placed).rstrip()

        table = "\n".join(line(row) for row in (header, *cells)) if cells else ""
        return "\n\n".join(part for part in ("\n".join(self.before), table, "\n".join(self.after)) if part)

    def to_html(self) -> str:
        """For a notebook. Everything that comes from outside is escaped."""
        header, cells, is_text = self._printed()

        def row(tag: str, texts: Sequence[str]) -> str:
            sides = ["left" if left else "right" for left in is_text]
            each = zip(texts, sides, strict=True)
            return "".join(f'<{tag} style="text-align:{s}">{html.escape(t)}</{tag}>' for t, s in each)

        head = f"<thead><tr>{row('th', header)}</tr></thead>"
        body = "".join(f"<tr>{row('td', texts)}</tr>" for texts in cells)
        table = f"<table>{head}<tbody>{body}</tbody></table>" if cells else ""
        return f"<div>{_paragraphs(self.before)}{table}{_paragraphs(self.after)}</div>"

    def to_frame(self) -> Any:
        """A pandas DataFrame with every row and column, numbers unrounded. Raises ImportError without
        pandas."""
        try:
            pandas = import_module("pandas")
        except ImportError as error:
            raise ImportError(not_installed("to_frame()", "pandas")) from error
        return pandas.DataFrame(list(self.rows), columns=list(self.names))

    def _printed(self) -> tuple[list[str], list[list[str]], list[bool]]:
        """Header, cells and which columns are text; the middle of a large table is left out."""
        columns, rows = self.columns, list(self.rows)
        is_text = [any(isinstance(row[at], str) for row in rows) for at in range(len(columns))]
        header = [column.name for column in columns]
        chosen = [*rows[:ENDS], None, *rows[-ENDS:]] if len(rows) > MOST_ROWS else rows
        cells = [
            [GAP] * len(columns)
            if row is None
            else [_printed_cell(cell, column) for cell, column in zip(row, columns, strict=True)]
            for row in chosen
        ]
        if len(columns) > MOST_COLUMNS:
            header, is_text = [*header[:MOST_COLUMNS], GAP], [*is_text[:MOST_COLUMNS], True]
            cells = [[*row[:MOST_COLUMNS], GAP] for row in cells]
        return header, cells, is_text


def _printed_cell(cell: Cell, column: Column) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "-"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:.{column.digits}f}" if isinstance(cell, float) else str(cell)


def _paragraphs(sentences: Sequence[str]) -> str:
    return "".join(f"<p>{html.escape(text)}</p>" for text in sentences)
