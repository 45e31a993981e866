"""How a table that some other program wrote is read: what each column is, and what separates them.

Read with its mapping, every cell passes the same checks as one of a take table, and refusals name the file's
own line and column.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, time
from itertools import islice
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadTakeTable
from glovecal_models.names import CHANNEL
from glovecal_models.takes.answer import PREFIX, ColumnMapping
from glovecal_models.takes.raw_table import (
    MOST_CELLS,
    MOST_COLUMNS,
    Column,
    RawTable,
    parse_header,
)
from glovecal_models.takes.read_table import (
    COMMENT,
    MAGIC,
    begins_a_number,
    checked_texts,
    load_pyarrow,
    parse_numbers,
    refuse_foreign_start,
)

SEPARATORS = (",", ";", "\t", "|", " ")
NOT_MEASURED = ("nan", "na", "n/a", "null", "none", "-", "--", "#n/a")
"""Cells that say so, in lower case."""
A_PAUSE_S = 2.0
"""So long without a frame, and another take begins where a mapping divides at pauses."""
ROWS_AT_ONCE = 512


def checked_columns(mapping: ColumnMapping, file: str) -> dict[int, Column]:
    """By its place, each column that is read, as it stands in a take table. Raises BadTakeTable."""
    if len(mapping.columns) > MOST_COLUMNS:
        raise BadTakeTable(f"{len(mapping.columns)} columns; at most {MOST_COLUMNS} are read", file=file)
    read = {at: item for at, item in enumerate(mapping.columns) if item.role != "ignored"}
    for item in read.values():
        if item.role in PREFIX and not CHANNEL.match(item.name):
            raise BadTakeTable(
                f"{item.name!r} cannot be a {item.role}'s name; write a letter, then letters, digits or "
                "_ (at most 64)",
                file=file,
                column=item.header,
            )
    again: dict[str, str] = {}
    for item in read.values():
        other = again.setdefault(item.in_a_take_table, item.header)
        if other is not item.header:
            raise BadTakeTable(
                f"would be {item.in_a_take_table}, as {other!r} is; name one of them otherwise or leave "
                "it out",
                file=file,
                column=item.header,
            )
    if not mapping.of("time"):
        raise BadTakeTable("no column holds the time of the frames; choose the one that does", file=file)
    found = parse_header([item.in_a_take_table for item in read.values()], file)
    return dict(zip(read, found, strict=True))


def mapped_table(path: Path, mapping: ColumnMapping) -> RawTable:
    """The whole table, every cell checked. Raises BadTakeTable with file, line, column and value."""
    file = path.name
    columns = checked_columns(mapping, file)
    numbers: dict[str, list[np.ndarray]] = {item.header: [] for item in columns.values() if not item.is_text}
    texts: dict[str, list[str]] = {item.header: [] for item in columns.values() if item.is_text}
    lines: list[int] = []
    with rows_of(path, mapping.separator) as rows:
        below = _data(rows, mapping, columns, file)
        while batch := list(islice(below, ROWS_AT_ONCE)):
            at = [line for line, _ in batch]
            for place, column in columns.items():
                cells = [row[place] for _, row in batch]
                if column.is_text:
                    texts[column.header].extend(checked_texts(column, cells, at, file))
                else:
                    numbers[column.header].append(_numbers(mapping, place, column, cells, at, file))
            lines.extend(at)
            if len(lines) * len(columns) > MOST_CELLS:
                raise BadTakeTable(f"more than {MOST_CELLS} cells; divide it into several files", file=file)
    if not lines:
        raise BadTakeTable("only a header, no rows; give at least one", file=file, line=mapping.header_line)
    joined = {header: np.concatenate(parts) for header, parts in numbers.items()}
    table = RawTable(file, tuple(columns.values()), joined, texts, np.array(lines))
    return _divided(table) if mapping.divides_at_pauses else table


@contextmanager
def rows_of(path: Path, separator: str) -> Iterator[Iterator[tuple[int, list[str]]]]:
    """The rows of a CSV or Parquet file as text, each with its line (Parquet: 1 is the names of the columns).

    Text is UTF-8, UTF-16 with its mark, or else Windows-1252. Raises BadTakeTable for what is no table.
    """
    with path.open("rb") as stream:
        start = stream.read(4)
    if start == MAGIC:
        yield _parquet_rows(path)
        return
    encoding = _encoding(path, start)
    with path.open(encoding=encoding, newline="") as stream:
        yield _text_rows(stream, separator, path.name)


def _encoding(path: Path, start: bytes) -> str:
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    refuse_foreign_start(path)
    with path.open("rb") as stream:
        if b"\0" in stream.read(4096):
            raise BadTakeTable(
                "not a table: it holds bytes that are no text; send CSV, text or Parquet", file=path.name
            )
    try:
        with path.open(encoding="utf-8-sig") as text:
            while text.read(2**20):
                pass
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _text_rows(stream, separator: str, file: str) -> Iterator[tuple[int, list[str]]]:  # a text file's lines
    if separator == " ":
        for line, text in enumerate(stream, start=1):
            if row := text.split():
                yield line, row
        return
    reader, begins = csv.reader(stream, delimiter=separator, skipinitialspace=separator != "\t"), 1
    while True:
        try:
            row = next(reader, None)
        except (csv.Error, UnicodeDecodeError) as error:
            raise BadTakeTable(
                "cannot be read as a table from here on; a quote may be unclosed: correct this line",
                file=file,
                line=begins,
            ) from error
        if row is None:
            return
        if any(cell.strip() for cell in row):
            yield begins, row
        begins = reader.line_num + 1


def _parquet_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    pyarrow = load_pyarrow()
    try:
        with pyarrow.parquet.ParquetFile(path) as source:
            yield 1, list(source.schema_arrow.names)
            line = 2
            for batch in source.iter_batches(batch_size=ROWS_AT_ONCE, use_threads=False):
                columns = [
                    ["" if cell is None else str(cell) for cell in column.to_pylist()]
                    for column in batch.columns
                ]
                for row in zip(*columns, strict=True):
                    yield line, list(row)
                    line += 1
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
        raise BadTakeTable(
            "not a readable Parquet file: it is damaged or cut off; write it again", file=path.name
        ) from error


def _data(
    rows: Iterator[tuple[int, list[str]]], mapping: ColumnMapping, columns: dict[int, Column], file: str
) -> Iterator[tuple[int, list[str]]]:
    """Rows below the header; comments, units and the header once more are passed over."""
    width = len(mapping.columns)
    numeric = [place for place, column in columns.items() if not column.is_text]
    for line, row in rows:
        if line <= mapping.header_line or row[0].lstrip().startswith(COMMENT):
            continue
        if len(row) < width:
            raise BadTakeTable(
                f"{len(row)} cells, but the table has {width} columns; correct this line",
                file=file,
                line=line,
            )
        if any(cell.strip() for cell in row[width:]):
            raise BadTakeTable(
                f"{len(row)} cells, but the table has {width} columns; correct this line",
                file=file,
                line=line,
            )
        if any(begins_a_number(row[place].strip()) for place in numeric):
            yield line, row


def _numbers(
    mapping: ColumnMapping, place: int, column: Column, cells: list[str], at: list[int], file: str
) -> np.ndarray:
    item = mapping.columns[place]
    named = replace(column, header=item.header or column.header)
    if item.unit == "date":
        return _seconds(named, cells, at, file)
    cells = [cell.strip() for cell in cells]
    if mapping.decimal_comma:
        cells = [cell.replace(",", ".") for cell in cells]
    if column.may_be_empty:
        cells = ["" if cell.lower() in NOT_MEASURED else cell for cell in cells]
    return parse_numbers(named, cells, at, file, scale=item.scale)


def _seconds(column: Column, cells: Sequence[str], at: Sequence[int], file: str) -> np.ndarray:
    try:
        return np.array([seconds_of(cell) for cell in cells])
    except ValueError as error:
        wrong = next(index for index, cell in enumerate(cells) if not is_a_date(cell))
        raise BadTakeTable(
            f"{cells[wrong][:40]!r} is no date or time of day; write it as 2026-03-01 10:00:00.250",
            file=file,
            line=at[wrong],
            column=column.header,
        ) from error


def seconds_of(text: str) -> float:
    """Of a date with its time (since 1970, UTC unless it says otherwise), or of a time of day (since
    midnight). Raises ValueError."""
    text = text.strip().replace(",", ".")
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        at = time.fromisoformat(re.sub(r"^(\d):", r"0\1:", text))
        return at.hour * 3600.0 + at.minute * 60.0 + at.second + at.microsecond / 1e6
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def is_a_date(text: str) -> bool:
    try:
        seconds_of(text)
    except ValueError:
        return False
    return not text.strip().replace(".", "").isdigit()


def _divided(table: RawTable) -> RawTable:
    """Where the time starts again, and after a pause, another take begins."""
    if "take" in table.texts:
        return table
    step = np.diff(table.time_s)
    number = np.concatenate([[0], np.cumsum((step < 0) | (step > A_PAUSE_S))]) + 1
    if number[-1] == 1:
        return table
    title = Path(table.file).stem
    digits = len(str(number[-1]))
    take = Column("take", "take", "take")
    return replace(
        table,
        columns=(*table.columns, take),
        texts=table.texts | {"take": [f"{title}-{at:0{digits}d}" for at in number]},
    )
