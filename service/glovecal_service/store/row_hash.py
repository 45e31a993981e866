"""Tables whose rows carry a sha256 of their values: the only way in which those tables are written and read.

Databases do not notice changed row contents by themselves: in trials 40 random overwrites of an SQLite file
were found 7 times by its integrity check. A table is protected by having the column ``row_sha256``; then all
its other columns are hashed but those the database itself numbers. NULL is left out of the hash, so a
nullable column can be added later and the rows there are stay valid.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC
from typing import Any, TypeVar

from sqlalchemy import ColumnElement, Connection, Row, Select, Table, insert, select, update
from sqlalchemy.types import Float

from glovecal_models.errors import BadInput
from glovecal_service.store.errors import DamagedRows, StoreDamaged
from glovecal_service.store.tables import Json, JsonText, Unreadable, UtcTime
from glovecal_service.store.texts import json_text

HASH = "row_sha256"
Record = TypeVar("Record")


def add_row(connection: Connection, table: Table, values: Mapping[str, Any]) -> Any:
    """Insert a row with its hash; its (first) primary key. Raises BadInput for what JSON cannot hold."""
    values = {**values, HASH: row_hash(table, values)}
    key = connection.execute(insert(table).values(**values)).inserted_primary_key
    return None if key is None else key[0]


def change_rows(
    connection: Connection,
    table: Table,
    which: ColumnElement[bool],
    change: Mapping[str, Any] | Callable[[dict[str, Any]], Mapping[str, Any]],
    *,
    skip_locked: bool = False,
) -> int:
    """Set columns of the rows ``which`` chooses and hash them anew; how many there were.

    ``change`` holds the new values, or gives them for the row as it is. The rows are locked first. One that
    was damaged raises StoreDamaged: a new hash would hide it.
    """
    rows = connection.execute(select(table).where(which).with_for_update(skip_locked=skip_locked)).all()
    for row in rows:
        before = sound_row(table, row)
        values = change(dict(before)) if callable(change) else change
        digest = row_hash(table, {**before, **values})
        same = [column == before[column.name] for column in table.primary_key.columns]
        connection.execute(update(table).where(*same).values({**values, HASH: digest}))
    return len(rows)


def sound_rows(
    connection: Connection,
    table: Table,
    chosen: Select[Any],
    make: Callable[[dict[str, Any]], Record],
    wanted: Mapping[str, Any] | None = None,
) -> list[Record]:
    """What ``make`` makes of the rows of ``chosen``, a selection of whole rows of ``table``; with ``wanted``
    of those that have these values (None: any), which is looked at when the row is known to be sound.

    Raises DamagedRows, which names each damaged row and holds the records of the others.
    """
    records, damaged = sort_out(table, connection.execute(chosen), make, wanted)
    if damaged:
        raise DamagedRows(damaged, records)
    return records


def sort_out(
    table: Table,
    rows: Iterable[Row[Any]],
    make: Callable[[dict[str, Any]], Record],
    wanted: Mapping[str, Any] | None = None,
) -> tuple[list[Record], list[str]]:
    """Records of the sound rows, and a sentence on each of the others."""
    records, damaged = [], []
    for row in rows:
        try:
            values = sound_row(table, row)
            if all(value is None or values[name] == value for name, value in (wanted or {}).items()):
                records.append(make(values))
        except StoreDamaged as error:
            damaged.append(str(error))
    return records, damaged


def sound_row(table: Table, row: Row[Any]) -> dict[str, Any]:
    """The row's values without its hash. Raises StoreDamaged unless they are what was written."""
    values = dict(row._mapping)
    for name, value in values.items():
        if isinstance(value, Unreadable):
            raise StoreDamaged(
                f"{_named(table, values)} is damaged: {name} holds {value}; restore a backup of the database"
            )
    expected = values.pop(HASH, None)
    if HASH in table.columns and not _matches(table, values, expected):
        raise StoreDamaged(
            f"{_named(table, values)} was changed after it was written; restore a backup of the database"
        )
    return {name: value.document if isinstance(value, JsonText) else value for name, value in values.items()}


def row_hash(table: Table, values: Mapping[str, Any]) -> str:
    """sha256 hex of the table's name and ``values`` as canonical JSON; NULL is left out."""
    content = {}
    for column in table.columns:
        value = values.get(column.name)
        if value is not None and column.name != HASH and column is not table.autoincrement_column:
            content[column.name] = _plain(column.type, value)
    text = json_text([table.name, content], sort_keys=True)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _plain(kind: Any, value: Any) -> Any:
    """The same for a value that is written and as it is read back: 0 s as 0.0, documents as their text."""
    if isinstance(kind, Json):
        return value.text if isinstance(value, JsonText) else json_text(value)
    if isinstance(kind, UtcTime):
        return value.astimezone(UTC).isoformat()
    return float(value) if isinstance(kind, Float) and isinstance(value, int) else value


def _matches(table: Table, values: Mapping[str, Any], expected: Any) -> bool:
    try:
        return row_hash(table, values) == expected
    except BadInput:  # infinity, or bytes where there was text
        return False


def _named(table: Table, values: Mapping[str, Any]) -> str:
    key = ", ".join(str(values[column.name])[:80] for column in table.primary_key.columns)
    return f"row {key!a} of table {table.name}"
