"""Rows of other people are not there: for an actor of some subjects every statement is narrowed to theirs.

One place for all statements, so that a query that is added later cannot forget it. What is of nobody is not
there either, except gloves: one that nobody wears can be put on.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

from sqlalchemy import (
    CTE,
    ColumnElement,
    Connection,
    Delete,
    Engine,
    Insert,
    Join,
    Select,
    Subquery,
    Table,
    Update,
    event,
    or_,
    select,
)
from sqlalchemy.sql import visitors

from glovecal_service.store import tables
from glovecal_service.store.actor import actor_of
from glovecal_service.store.errors import NotFound

_OWN = {tables.subjects: tables.subjects.c.name} | {
    table: table.c.subject
    for table in (tables.takes, tables.models, tables.activations, tables.recordings, tables.samplings,
                  tables.jobs, tables.damages)
}  # fmt: skip
_OF_A_PARENT = {
    tables.model_takes: (tables.model_takes.c.model, tables.models),
    tables.job_events: (tables.job_events.c.job, tables.jobs),
}
_FOREIGN_OR_MISSING = "there is no subject {name!r}; ask for one of yours"


def narrow_statements(engine: Engine) -> None:
    """From now on; the engine's own options (other begins) share its events."""
    event.listen(engine, "before_execute", _narrowed, retval=True)


def _narrowed(
    connection: Connection, statement: Any, many: Any, values: Any, options: Any
) -> tuple[Any, Any, Any]:
    subjects = actor_of(connection).subjects
    if subjects is not None and isinstance(statement, Select | Update | Delete | Insert):
        if isinstance(statement, Insert):
            _require_own(statement, many, values, subjects)
        narrow = partial(_narrow, subjects=subjects)
        kinds = ("select", "update", "delete")
        statement = visitors.cloned_traverse(statement, {}, dict.fromkeys(kinds, narrow))
    return statement, many, values


def _narrow(part: Any, subjects: frozenset[str]) -> None:
    """Of a clone, which may be changed."""
    sources = part.get_final_froms() if isinstance(part, Select) else [part.table]
    for table in dict.fromkeys(table for source in sources for table in _tables(source)):
        condition = _condition(table, subjects)
        if condition is not None:
            part.__dict__.update(part.where(condition).__dict__)


def _tables(source: Any) -> Iterator[Table]:
    """Of a join; a subquery is narrowed by itself. Raises for what nobody thought of, an alias: rather than
    show other people's rows."""
    if isinstance(source, Table):
        yield source
    elif isinstance(source, Join):
        yield from _tables(source.left)
        yield from _tables(source.right)
    elif not isinstance(source, Subquery | CTE):
        raise AssertionError(f"{type(source).__name__} in a statement cannot be narrowed to subjects")


def _condition(table: Table, subjects: frozenset[str]) -> ColumnElement[bool] | None:
    if table is tables.gloves:
        return or_(table.c.subject.is_(None), table.c.subject.in_(subjects))
    if table in _OWN:
        return _OWN[table].in_(subjects)
    if table in _OF_A_PARENT:
        column, parent = _OF_A_PARENT[table]
        key = next(iter(parent.primary_key.columns))
        return column.in_(select(key).where(_OWN[parent].in_(subjects)))
    return None


def _require_own(statement: Insert, many: Any, values: Any, subjects: frozenset[str]) -> None:
    column = _OWN.get(statement.table) if isinstance(statement.table, Table) else None
    if column is None:
        return
    given = [statement.compile().params, *(many or []), values or {}]
    for row in given:
        name = row.get(column.name)
        if name is not None and name not in subjects:
            raise NotFound(_FOREIGN_OR_MISSING.format(name=name))
