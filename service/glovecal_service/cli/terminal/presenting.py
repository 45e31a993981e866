"""A presentation on a terminal: tables fitted to it, explanations on standard error; no pictures."""

from __future__ import annotations

from rich.table import Table as RichTable

from glovecal_models.presentation.document import Block, Lines, Note, Part, Presentation, Table
from glovecal_service.cli.terminal.printing import err, out, show


def present(shown: Presentation, also: str | None = None) -> None:
    """``also``: details whose heading begins so are printed too."""
    out.print(f"{shown.title}:")
    for item in shown.summary:
        out.print(f"{item.label}: {item.text}" if item.label else item.text)
    for note in shown.notes:
        out.print()
        _part(note)
    for section in shown.shown:
        is_wanted = not section.is_detail or (also is not None and section.heading.startswith(also))
        if is_wanted and any(map(_is_printed, section.parts)):
            out.print(f"\n{section.heading}:")
            for part in section.parts:
                _part(part)


def _is_printed(part: Part) -> bool:
    if isinstance(part, Block):
        return any(isinstance(inner, Table) for inner in part.parts)
    return isinstance(part, Table | Lines | Note | str)


def _part(part: Part) -> None:
    if isinstance(part, Table):
        print_part_table(part)
    elif isinstance(part, Lines | Note):
        if isinstance(part, Note) and part.heading:
            out.print(f"{part.heading}:")
        for sentence in part.sentences:
            out.print(f"  {sentence}")
    elif isinstance(part, Block):
        for inner in part.parts:
            if isinstance(inner, Table):
                print_part_table(inner)
    elif isinstance(part, str):
        out.print(part)


def print_part_table(table: Table) -> None:
    """Numbers to the right; on a narrow terminal what folds, else the last column, wraps."""
    if not table.rows:
        out.print(table.empty)
        return
    rich = RichTable(box=None, pad_edge=False, header_style="bold")
    folding = {at for at, item in enumerate(table.columns) if item.folds} or {len(table.columns) - 1}
    for at, (heading, is_word) in enumerate(zip(table.headings, table.are_words, strict=True)):
        rich.add_column(
            heading, justify="left" if is_word else "right", no_wrap=at not in folding,
            min_width=len(heading), overflow="fold",
        )  # fmt: skip
    for row in table.texts[: table.printed]:
        rich.add_row(*row)
    show(rich)
    if rich.row_count < len(table.rows):
        out.print(f"and {len(table.rows) - rich.row_count} more")
    if table.legend:
        err.print(table.legend)
