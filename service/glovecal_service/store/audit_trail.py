"""What was changed, by whom, from where: written in the change's own transaction, each entry chained to the
one before by its hash.

Seen are the statements themselves, so a change that is added later is written down too. What changes all the
time and decides nothing (how far a job is, when a glove was last seen) is left out.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, Delete, Engine, Insert, Table, Update, event, insert, select, update

from glovecal_service.store import tables
from glovecal_service.store.actor import actor_of
from glovecal_service.store.texts import json_text

WATCHED: Mapping[Table, tuple[str, ...]] = {
    tables.subjects: ("title", "dimensions", "hand"),
    tables.layouts: ("document",),
    tables.gloves: ("layout", "subject", "wearing", "hand", "latency", "delay_ms"),
    tables.takes: ("name", "subject", "layout", "wearing", "artifact", "facts"),
    tables.models: ("subject", "layout", "method", "parent", "facts", "hand"),
    tables.activations: ("subject", "layout", "model", "kind", "hand"),
    tables.recordings: ("glove", "name", "subject"),
    tables.samplings: ("glove", "subject", "open"),
    tables.jobs: ("kind", "subject", "payload", "cancel_requested"),
    tables.keys: ("role", "subjects", "revoked_at", "password_changed_at", "issuer"),
}
"""Tables whose changes are written down, and of which columns."""
LONGEST_VALUE = 300
"""Characters of a value; of a longer one its hash is kept."""
MOST_ROWS = 50
"""Of one statement; of more their number is kept."""
_OPEN, _BEFORE = "glovecal_audit", "glovecal_audit_before"


def watch_changes(engine: Engine) -> None:
    event.listen(engine, "before_execute", _remember)
    event.listen(engine, "after_execute", _note)


@contextmanager
def written_down(connection: Connection) -> Iterator[None]:
    """Changes of the block become one entry of the log, in the same transaction."""
    info = connection.info  # of a connection that broke meanwhile it cannot be asked any more
    info[_OPEN] = []
    try:
        yield
        changes = info.pop(_OPEN)
        if changes:
            _append(connection, changes)
    finally:
        info.pop(_OPEN, None)
        info.pop(_BEFORE, None)


def tell_instead(connection: Connection, changes: list[dict[str, Any]]) -> None:
    """The entry of this transaction holds these changes, not those of its statements so far: where a person
    is erased their values are not written down once more."""
    connection.info[_OPEN] = changes


def _append(connection: Connection, changes: list[dict[str, Any]]) -> None:
    head = connection.execute(select(tables.audit_head).with_for_update()).one()
    who = actor_of(connection)
    number = int(head._mapping["count"]) + 1  # a row has a method of this name
    entry = {
        "id": number, "at": datetime.now(UTC), "changes": changes, "previous": head.sha256,
        "who": who.name, "origin": who.origin, "action": who.action,
    }  # fmt: skip
    entry["sha256"] = entry_sha256(entry)
    connection.execute(insert(tables.audit).values(**entry))
    connection.execute(update(tables.audit_head).values(count=number, sha256=entry["sha256"]))


def entry_sha256(entry: Mapping[str, Any]) -> str:
    """Of all that an entry says, the hash of the one before it among them."""
    content = [entry[name] for name in ("id", "who", "origin", "action", "changes", "previous")]
    text = json_text([entry["at"].astimezone(UTC).isoformat(), *content], sort_keys=True)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _watched(connection: Connection, statement: Any) -> tuple[str, ...] | None:
    """Columns of which a change is written down; None where the statement changes none of them."""
    if _OPEN not in connection.info or not isinstance(statement, Insert | Update | Delete):
        return None
    table = statement.table
    columns = WATCHED.get(table) if isinstance(table, Table) else None
    if columns is None or not isinstance(statement, Update):
        return columns
    return columns if set(statement.compile().params) & set(columns) else None


def _rows(
    connection: Connection, table: Table, where: Any, columns: tuple[str, ...]
) -> dict[str, dict[str, Any]]:
    chosen = select(*table.primary_key.columns, *(table.c[name] for name in columns)).limit(MOST_ROWS + 1)
    rows = {}
    for row in connection.execute(chosen if where is None else chosen.where(where)):
        key = "/".join(str(row._mapping[column]) for column in table.primary_key.columns)
        rows[key] = {name: _brief(row._mapping[table.c[name]]) for name in columns}
    return rows


def _remember(connection: Connection, statement: Any, many: Any, values: Any, options: Any) -> None:
    columns = _watched(connection, statement)
    if columns is not None and isinstance(statement, Update | Delete) and isinstance(statement.table, Table):
        connection.info[_BEFORE] = _rows(connection, statement.table, statement.whereclause, columns)


def _note(connection: Connection, statement: Any, many: Any, values: Any, options: Any, result: Any) -> None:
    columns = _watched(connection, statement)
    if columns is None:
        return
    table = statement.table
    changes: list[dict[str, Any]] = connection.info[_OPEN]
    if isinstance(statement, Insert):
        rows = many or [{**statement.compile().params, **(values or {})}]
        for row in rows[:MOST_ROWS]:
            key = "/".join(str(row.get(column.name, "")) for column in table.primary_key.columns)
            after = {name: _brief(row[name]) for name in columns if row.get(name) is not None}
            changes.append({"table": table.name, "key": key, "after": after})
        return
    before: dict[str, dict[str, Any]] = connection.info.pop(_BEFORE, {})
    if isinstance(statement, Delete):
        changes += [{"table": table.name, "key": key, "before": row} for key, row in before.items()]
    else:
        for key, old in before.items():
            keys = dict(zip(table.primary_key.columns, key.split("/"), strict=True))
            same = [column == value for column, value in keys.items()]
            now_there = _rows(connection, table, same[0] if len(same) == 1 else same[0] & same[1], columns)
            new = now_there.get(key, {})
            differing = [name for name in columns if old[name] != new.get(name)]
            if differing:
                changes.append({
                    "table": table.name, "key": key,
                    "before": {name: old[name] for name in differing},
                    "after": {name: new.get(name) for name in differing},
                })  # fmt: skip
    if len(before) > MOST_ROWS:
        changes.append({"table": table.name, "key": f"and more than {MOST_ROWS} rows"})


def _brief(value: Any) -> Any:
    """As JSON holds it; of what is long its hash."""
    value = getattr(value, "document", value)
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat()
    text = json_text(value)
    if len(text) <= LONGEST_VALUE:
        return value
    return {"sha256": hashlib.sha256(text.encode()).hexdigest(), "characters": len(text)}
