"""What a table would become if it were imported: its columns, its takes, what is odd."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

from glovecal_models.errors import BadInput, BadTakeTable
from glovecal_models.takes.answer import PREFIX, ColumnMapping, EqualTimes, TablePreview, TakeInTable
from glovecal_models.takes.column_guess import channel_name, guess_mapping
from glovecal_models.takes.column_mapping import rows_of
from glovecal_models.takes.joined_reference import JoinedReference, ReferencesByTake, join_references
from glovecal_models.takes.raw_table import parse_header
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import take_warnings

ROWS_SHOWN = 5
LONGEST_CELL = 40


def preview_table(
    path: Path,
    mapping: ColumnMapping | None = None,
    *,
    wearing: str | None = None,
    kept: Callable[[str], ColumnMapping | None] = lambda shape: None,
    references: Sequence[ReferencesByTake] = (),
) -> TablePreview:
    """Look at a CSV or Parquet file. ``mapping``: how it is read (default: a take table as such, else as the
    last one of its shape was, which ``kept`` knows, else as it is guessed); channels without a name get one.
    ``references``: angles of other files that its takes are joined with. Raises BadTakeTable for what is no
    table of numbers."""
    guessed, is_own = guess_mapping(path), _is_take_table(path)
    as_before = None if mapping is not None or is_own else kept(guessed.shape)
    shown = _all_named(mapping or as_before or guessed)
    as_read = None if is_own and mapping is None else shown
    takes, equal_times, problem = _taken(path, as_read, wearing)
    joined: list[JoinedReference] = []
    if references and problem is None:
        try:
            joined = join_references(takes, references)
        except BadInput as error:
            problem, takes = str(error), []
        else:
            takes = [each.take for each in joined]
    how_joined = [each.sentence for each in joined]
    return TablePreview(
        path.name, is_own, as_before is not None, shown, equal_times, [_of_take(take) for take in takes],
        _first(path, shown), [*how_joined, *take_warnings(takes)], problem,
    )  # fmt: skip


def foreign_mapping(
    path: Path, kept: Callable[[str], ColumnMapping | None] = lambda shape: None
) -> ColumnMapping | None:
    """As ``preview_table`` reads a file that nobody gave a mapping for; None for a take table. Raises
    BadTakeTable."""
    if _is_take_table(path):
        return None
    guessed = guess_mapping(path)
    return _all_named(kept(guessed.shape) or guessed)


def _all_named(mapping: ColumnMapping) -> ColumnMapping:
    columns = (
        item
        if item.role not in PREFIX or item.name
        else replace(item, name=channel_name(item.header, item.role))
        for item in mapping.columns
    )
    return replace(mapping, columns=tuple(columns))


def _is_take_table(path: Path) -> bool:
    with rows_of(path, ",") as rows:
        first = next(rows, None)
    try:
        parse_header(first[1] if first else [], path.name)
    except BadTakeTable:
        return False
    return True


def _taken(
    path: Path, mapping: ColumnMapping | None, wearing: str | None
) -> tuple[list[Take], EqualTimes, str | None]:
    problem = None
    both: tuple[EqualTimes, EqualTimes] = ("refuse", "spread")
    for equal_times in both:
        try:
            found = read_takes(path, wearing=wearing, equal_times=equal_times, mapping=mapping)
        except BadTakeTable as error:
            problem = str(error)
        else:
            return found, equal_times, None
    return [], "refuse", problem


def _of_take(take: Take) -> TakeInTable:
    frames = len(take.time_s)
    rate_hz = (frames - 1) / take.duration_s if take.duration_s > 0 else None
    return TakeInTable(
        take.name, take.wearing, frames, take.duration_s, rate_hz, len(take.sensors), take.rotations
    )


def _first(path: Path, mapping: ColumnMapping) -> list[list[str]]:
    with rows_of(path, mapping.separator) as rows:
        below = (row for line, row in rows if line > mapping.header_line)
        return [[cell.strip()[:LONGEST_CELL] for cell in row] for row in islice(below, ROWS_SHOWN)]
