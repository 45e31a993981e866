"""Reading a take table from CSV or Parquet, every cell checked.

CSV: UTF-8 (with or without a mark at its start), commas, decimal points. Parquet needs pyarrow, the extra
``parquet``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput, BadTakeTable
from glovecal_models.installation import not_installed
from glovecal_models.takes.raw_table import (
    MOST_CELLS,
    Column,
    RawTable,
    parse_header,
    unusable_number,
    unusable_text,
    what_is_right,
    what_is_wrong,
)

COMMENT = ("#", "%", "//")
"""Begin lines that other programs pass over."""
_THOUSANDS = re.compile(r"([+-]?[1-9]\d{0,2}(?:([,.' \xa0\u2009\u202f])\d{3})(?:\2\d{3})*)([.,]\d+)?\Z")
_HEADER_WITHIN = 40
_ROWS_AT_ONCE = 128  # small enough to stay in the cache; 4096 took a third longer
_FOREIGN_STARTS = {
    b"\xff\xfe": "UTF-16 text; save it as UTF-8",
    b"\xfe\xff": "UTF-16 text; save it as UTF-8",
    b"PK\x03\x04": "a spreadsheet or archive; export it as CSV",
    b"\x1f\x8b": "compressed with gzip; unpack it first",
}


def read_csv_table(path: Path) -> RawTable:
    """The whole table, every cell checked. Raises BadTakeTable with file, line, column and value."""
    refuse_foreign_start(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            return _read(csv.reader(stream, strict=True, skipinitialspace=True), path.name)
    except UnicodeDecodeError as error:
        raise _undecodable(path) from error


def _read(reader, file: str) -> RawTable:  # csv.reader's type has no public name
    rows = _numbered_rows(reader, file)
    first = next(rows, None)
    if first is None:
        raise BadTakeTable("the file is empty", file=file)
    columns = _parse_csv_header(*first, rows, file)
    numbers: dict[str, list[np.ndarray]] = {c.header: [] for c in columns if not c.is_text}
    texts: dict[str, list[str]] = {c.header: [] for c in columns if c.is_text}
    lines: list[int] = []
    while batch := list(islice(rows, _ROWS_AT_ONCE)):
        at = [line for line, _ in batch]
        cells = [row for _, row in batch]
        try:
            _require_full_rows(cells, at, columns, file)
            for column, values in zip(columns, zip(*cells, strict=True), strict=True):
                if column.is_text:
                    texts[column.header].extend(checked_texts(column, values, at, file))
                else:
                    numbers[column.header].append(parse_numbers(column, values, at, file))
        except BadTakeTable as error:
            stray = _stray_line(cells[at.index(error.line)], columns) if error.line in at else None
            if stray is None:
                raise
            raise BadTakeTable(f"{stray}; remove this line", file=file, line=error.line) from error
        lines.extend(at)
        if len(lines) * len(columns) > MOST_CELLS:
            raise BadTakeTable(f"more than {MOST_CELLS} cells; divide it into several files", file=file)
    if not lines:
        raise BadTakeTable("only a header, no rows; give at least one", file=file, line=1)
    joined = {header: np.concatenate(parts) for header, parts in numbers.items()}
    return RawTable(file, tuple(columns), joined, texts, np.array(lines))


def _numbered_rows(reader, file: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with the line each begins on; blank lines are passed over."""
    begins = 1
    while True:
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise BadTakeTable(
                "cannot be read as CSV from here on; a quote may be unclosed, or a field larger than "
                "131072 characters",
                file=file,
                line=begins,
            ) from error
        if row:
            yield begins, row
        begins = reader.line_num + 1


def _stray_line(cells: Sequence[str], columns: Sequence[Column]) -> str | None:
    """What a line is that is no row of a table; None where a row of it may be meant."""
    if cells[0].lstrip().startswith(COMMENT):
        return "this is a comment"
    if [cell.strip() for cell in cells] == [column.header for column in columns]:
        return "these are the names of the columns again"
    if len(cells) != len(columns):
        return None
    written = [
        cell for cell, column in zip(cells, columns, strict=True) if cell.strip() and not column.is_text
    ]
    if not any(map(begins_a_number, written)):
        return f"no number stands here ({', '.join(cells)[:60]}): units, or nothing at all"
    return None


def begins_a_number(cell: str) -> bool:
    return _is_number(cell) or cell.lstrip(" +-.,'\xa0")[:1].isdigit()


def _parse_csv_header(
    line: int, headers: Sequence[str], rows: Iterator[tuple[int, list[str]]], file: str
) -> list[Column]:
    first = headers[0].strip()
    if first.startswith(COMMENT):
        raise BadTakeTable("this is a comment; remove this line", file=file, line=line)
    if first.lower().startswith("sep="):
        raise BadTakeTable(
            "this tells a spreadsheet what separates columns, which are commas here; remove this line",
            file=file,
            line=line,
        )
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(headers) == 1 and mark in headers[0]:
            raise BadTakeTable(
                f"columns are separated by {name}; save the table with commas between columns "
                "and points in decimal numbers",
                file=file,
                line=line,
            )
    if not _has_time(headers):
        later = next((at for at, row in islice(rows, _HEADER_WITHIN) if _has_time(row)), None)
        if later is not None:
            raise BadTakeTable(
                f"the columns are named in line {later}; remove the lines above it", file=file, line=line
            )
    return parse_header(headers, file)


def _has_time(cells: Sequence[str]) -> bool:
    return "time_s" in (cell.strip() for cell in cells)


def _require_full_rows(
    rows: Sequence[Sequence[str]], lines: Sequence[int], columns: Sequence[Column], file: str
) -> None:
    width = len(columns)
    for row, line in zip(rows, lines, strict=True):
        if len(row) != width:
            decimal = " (decimal commas? write points)" if len(row) > width else ""
            raise BadTakeTable(
                f"{len(row)} cells, but the header has {width} columns{decimal}", file=file, line=line
            )


def parse_numbers(
    column: Column, cells: Sequence[str], lines: Sequence[int], file: str, scale: float = 1.0
) -> np.ndarray:
    """The numbers of a column's cells times ``scale``. Raises BadTakeTable."""
    filled = [cell or "nan" for cell in cells] if column.may_be_empty and "" in cells else cells
    together = "".join(cells)
    plain = together.isascii() and "_" not in together  # float() also reads 1_000 and other scripts' digits
    try:
        if not plain:
            raise ValueError
        values = np.fromiter(map(float, filled), float, len(filled))
    except ValueError:
        index = next(i for i, cell in enumerate(filled) if not _is_number(cell))
        raise _bad_cell(column, cells[index], lines[index], file) from None
    values = values * scale
    unusable = unusable_number(column, values)
    if unusable is not None:
        raise _bad_cell(column, cells[unusable], lines[unusable], file)
    return values


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return cell.isascii() and "_" not in cell


def _bad_cell(column: Column, cell: str, line: int, file: str) -> BadTakeTable:
    shown = cell.strip() if len(cell) <= 60 else f"{cell[:60]}... ({len(cell)} characters)"
    if _is_number(cell):
        problem = what_is_wrong(column, float(cell), shown)
    elif not cell.strip():
        problem = f"the cell is empty; {what_is_right(column)}"
    else:
        problem = f"{shown!r} is not a number{_comma_hint(cell.strip())}; {what_is_right(column)}"
    return BadTakeTable(problem, file=file, line=line, column=column.header, value=cell[:60])


def _comma_hint(cell: str) -> str:
    """What separates digits in a cell that is no number: thousands where three follow, else decimals."""
    if thousands := _THOUSANDS.match(cell):
        whole = re.sub(r"[^\d+-]", "", thousands[1]) + (thousands[3] or "").replace(",", ".")
        return f" (a separator of thousands? write {whole}; a decimal comma? write a point)"
    return " (write a decimal point, not a comma)" if _is_number(cell.replace(",", ".", 1)) else ""


def checked_texts(column: Column, texts: Sequence[str], lines: Sequence[int], file: str) -> Sequence[str]:
    unusable = unusable_text(column, texts)
    if unusable is not None:
        index, problem = unusable
        raise BadTakeTable(problem, file=file, line=lines[index], column=column.header)
    return texts


def refuse_foreign_start(path: Path) -> None:
    with path.open("rb") as stream:
        start = stream.read(4)
    for mark, what in _FOREIGN_STARTS.items():
        if start.startswith(mark):
            raise BadTakeTable(f"this is {what}", file=path.name)


def _undecodable(path: Path) -> BadTakeTable:
    with path.open("rb") as stream:
        for line, content in enumerate(stream, start=1):
            try:
                content.decode("utf-8")
            except UnicodeDecodeError as error:
                byte = content[error.start]
                return BadTakeTable(
                    f"byte 0x{byte:02x} is not UTF-8 text; save the table as UTF-8", file=path.name, line=line
                )
    return BadTakeTable("not UTF-8 text; save the table as UTF-8", file=path.name)


MAGIC = b"PAR1"


def load_pyarrow() -> Any:
    """The packages pyarrow and pyarrow.parquet, or BadInput with the command that installs them."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise BadInput(f"{not_installed('a Parquet table', 'pyarrow')} (or use CSV)") from error
    return pyarrow


def read_parquet_table(path: Path) -> RawTable:
    """The whole table, every cell checked. Raises BadTakeTable with file, row, column and value."""
    pyarrow = load_pyarrow()
    try:
        return _read_parquet(pyarrow, path)
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
        raise BadTakeTable(
            "not a readable Parquet file: it is damaged or cut off; write it again", file=path.name
        ) from error


def _read_parquet(pyarrow: Any, path: Path) -> RawTable:
    file = path.name
    with pyarrow.parquet.ParquetFile(path) as source:
        columns = parse_header(source.schema_arrow.names, file)
        if source.metadata.num_rows * len(columns) > MOST_CELLS:
            raise BadTakeTable(f"more than {MOST_CELLS} cells; divide it into several files", file=file)
        table = source.read(use_threads=False)
    if table.num_rows == 0:
        raise BadTakeTable("no rows; give at least one", file=file)
    numbers: dict[str, np.ndarray] = {}
    texts: dict[str, list[str]] = {}
    for column, values in zip(columns, table.columns, strict=True):
        if column.is_text:
            texts[column.header] = _texts(pyarrow, column, values, file)
        else:
            numbers[column.header] = _numbers(pyarrow, column, values, file)
    return RawTable(file, tuple(columns), numbers, texts, None)


def _numbers(pyarrow: Any, column: Column, values: Any, file: str) -> np.ndarray:
    types = pyarrow.types
    kind = values.type
    if not (
        types.is_floating(kind) or types.is_integer(kind) or types.is_decimal(kind) or types.is_null(kind)
    ):
        raise BadTakeTable(f"holds {kind}; {what_is_right(column)}", file=file, column=column.header)
    result = np.asarray(values.cast(pyarrow.float64(), safe=False).to_numpy(), dtype=float)
    unusable = unusable_number(column, result)
    if unusable is not None:
        found = values[unusable].as_py()
        problem = (
            f"the cell is empty; {what_is_right(column)}"
            if found is None
            else what_is_wrong(column, result[unusable], str(found)[:60])
        )
        raise BadTakeTable(
            f"row {unusable + 1}: {problem}", file=file, column=column.header, value=str(found)[:60]
        )
    return result


def _texts(pyarrow: Any, column: Column, values: Any, file: str) -> list[str]:
    kind = values.type.value_type if pyarrow.types.is_dictionary(values.type) else values.type
    is_text = pyarrow.types.is_string(kind) or pyarrow.types.is_large_string(kind)
    if not (is_text or pyarrow.types.is_integer(kind) or pyarrow.types.is_null(kind)):
        raise BadTakeTable(f"holds {kind}; write text", file=file, column=column.header)
    texts = ["" if value is None else str(value) for value in values.to_pylist()]
    unusable = unusable_text(column, texts)
    if unusable is not None:
        index, problem = unusable
        raise BadTakeTable(f"row {index + 1}: {problem}", file=file, column=column.header)
    return texts
