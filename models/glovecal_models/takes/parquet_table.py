"""Reading a take table from Parquet. Needs pyarrow, the extra ``parquet``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput, BadTakeTable
from glovecal_models.takes.columns import Column, parse_header
from glovecal_models.takes.raw_table import (
    MOST_CELLS,
    RawTable,
    unusable_number,
    unusable_text,
    what_is_right,
    what_is_wrong,
)

MAGIC = b"PAR1"


def load_pyarrow() -> Any:
    """The packages pyarrow and pyarrow.parquet, or BadInput with the command that installs them."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise BadInput(
            "Parquet tables need pyarrow: pip install 'glovecal-models[parquet]' (or use CSV)"
        ) from error
    return pyarrow


def read_parquet_table(path: Path) -> RawTable:
    """The whole table, every cell checked. Raises BadTakeTable with file, row, column and value."""
    pyarrow = load_pyarrow()
    try:
        return _read(pyarrow, path)
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
        raise BadTakeTable(f"not a readable Parquet file: {str(error)[:200]}", file=path.name) from error


def _read(pyarrow: Any, path: Path) -> RawTable:
    file = path.name
    with pyarrow.parquet.ParquetFile(path) as source:
        columns = parse_header(source.schema_arrow.names, file)
        if source.metadata.num_rows * len(columns) > MOST_CELLS:
            raise BadTakeTable(f"more than {MOST_CELLS} cells; divide it into several files", file=file)
        table = source.read(use_threads=False)
    if table.num_rows == 0:
        raise BadTakeTable("no rows", file=file)
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
