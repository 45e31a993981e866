"""Of a list that may be long: how many rows, from where on, and what they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, String, Table, and_, cast, func, or_, select
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement

AT_ITS_BEGINNING = "^"
FEWEST_OF_AN_ID = 4
"""Letters: one in sixteen ids begins with any given digit."""


@dataclass(frozen=True)
class ListPart:
    """``limit`` rows (None: all) from ``offset`` on, in the list's order or in ``reverse``; with ``text``
    those in which each of its words is found.

    ``searched`` columns, in the methods: ``name``; ``facts.note`` is a key of a JSON document, and what ``^``
    stands before has to begin with a word, of four letters or more.
    """

    limit: int | None = None
    offset: int = 0
    reverse: bool = False
    text: str = ""

    def of(
        self, chosen: Select[Any], table: Table, searched: Sequence[str], *, newest_first: bool
    ) -> Select[Any]:
        """``chosen`` rows of ``table``, ordered by when they were added."""
        at = table.c.created_at
        first = at.desc() if newest_first != self.reverse else at
        ordered = chosen.where(self._holds(table, searched)).order_by(first, table.c.id)
        return ordered if self.limit is None else ordered.offset(self.offset).limit(self.limit)

    def count(
        self, connection: Connection, chosen: Select[Any], table: Table, searched: Sequence[str]
    ) -> int:
        """All in which the text is found, on whichever part."""
        rows = chosen.where(self._holds(table, searched)).subquery()
        return connection.scalar(select(func.count()).select_from(rows)) or 0

    def _holds(self, table: Table, searched: Sequence[str]) -> ColumnElement[bool]:
        words = self.text.split()
        return and_(True, *(or_(*_found_in(table, searched, word)) for word in words))


WHOLE = ListPart()


def _found_in(table: Table, searched: Sequence[str], word: str) -> list[ColumnElement[bool]]:
    is_short = len(word) < FEWEST_OF_AN_ID
    return [
        _found(table, name, word) for name in searched if not (is_short and name.startswith(AT_ITS_BEGINNING))
    ]


def _found(table: Table, name: str, word: str) -> ColumnElement[bool]:
    """Capitals or not, as far as the database knows them."""
    column, *keys = name.removeprefix(AT_ITS_BEGINNING).split(".")
    text = _TextIn(table.c[column], *keys) if keys else cast(table.c[column], String)
    is_found = text.istartswith if name.startswith(AT_ITS_BEGINNING) else text.icontains
    return is_found(word, autoescape=True)


class _TextIn(FunctionElement[str]):
    """What a JSON document holds under some keys, as text; NULL where it is nothing, or no JSON any more."""

    type = String()
    inherit_cache = True

    def __init__(self, column: ColumnElement[Any], *keys: str) -> None:
        super().__init__(column, ".".join(keys))


@compiles(_TextIn)
def _on_sqlite(element: _TextIn, compiler: Any, **options: Any) -> str:
    column, keys = element.clauses
    document = compiler.process(column, **options)
    return f"CASE WHEN json_valid({document}) THEN json_extract({document}, '$.{keys.value}') END"


@compiles(_TextIn, "postgresql")
def _on_postgresql(element: _TextIn, compiler: Any, **options: Any) -> str:
    column, keys = element.clauses
    return f"({compiler.process(column, **options)} #>> '{{{keys.value.replace('.', ',')}}}')"
