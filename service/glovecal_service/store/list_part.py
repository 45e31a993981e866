"""Of a list that may be long: where a part of it begins, how many rows it has, and what they hold.

A part begins after the row where the last one ended (keyset paging), so that the hundredth costs what the
first does, and none is given twice where rows come or go meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Generic, TypeVar

from sqlalchemy import (
    ColumnElement,
    Connection,
    Row,
    Select,
    String,
    Table,
    and_,
    func,
    or_,
    select,
    tuple_,
)
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement
from sqlalchemy.types import NullType

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import HANDS, Handedness
from glovecal_service.store.row_hash import sort_out
from glovecal_service.store.tables import UtcTime
from glovecal_service.store.texts import json_text

AT_ITS_BEGINNING = "^"
FEWEST_OF_AN_ID = 4
"""Letters: one in sixteen ids begins with any given digit."""
BETWEEN = "~"
"""Stands between the values of a place in a list."""
LONGEST_PLACE = 200
Record = TypeVar("Record")


@dataclass(frozen=True)
class ListPart:
    """``limit`` rows (None: all) ``after`` a place ("": from the beginning), in the list's order or in
    ``reverse``; with ``text`` those in which each of its words is found, and from ``since`` on, before
    ``until``."""

    limit: int | None = None
    after: str = ""
    reverse: bool = False
    text: str = ""
    since: datetime | None = None
    until: datetime | None = None


WHOLE = ListPart()


@dataclass(frozen=True)
class Page(Generic[Record]):
    """The records of one part."""

    records: list[Record]
    damaged: list[str] = field(default_factory=list)
    """A sentence on each row that is left out."""
    after: str | None = None
    """Where the next part begins; None: this is the last."""
    total: int | None = None
    """Rows of all parts; None: more than are here, and not counted, as each would have to be read."""


@dataclass(frozen=True)
class Listing:
    """How rows of a table are listed.

    ``by``: columns that order them, the last one their key; ``searched``: columns for the words of a text, in
    which ``facts.note`` is a key of a JSON document, and what ``^`` stands before has to begin with a word,
    of four letters or more.
    """

    table: Table
    by: tuple[str, ...] = ("created_at", "id")
    newest_first: bool = False
    searched: tuple[str, ...] = ()

    def page(
        self,
        connection: Connection,
        make: Callable[[dict[str, Any]], Record],
        part: ListPart,
        *wanted: ColumnElement[bool] | None,
        hidden: ColumnElement[bool] | None = None,
    ) -> Page[Record]:
        """Of rows for which all ``wanted`` conditions hold (None: no condition), and not ``hidden``, of which
        there are few. Raises BadInput for a place that is none."""
        conditions = [each for each in (*wanted, *self._within(part)) if each is not None]
        shown = [*conditions, self._holds(part.text), *([] if hidden is None else [~hidden])]
        rows, after = self._rows(connection, part, shown)
        records, damaged = sort_out(self.table, rows, make)
        total = None
        if part.text:
            total = len(rows) if after is None and not part.after else None
        else:
            total = self._count(connection, conditions)
            if hidden is not None:
                total -= self._count(connection, [*conditions, hidden])
        return Page(records, damaged, after, total)

    def every(self, *wanted: ColumnElement[bool] | None, part: ListPart = WHOLE) -> Select[Any]:
        """All rows of ``part`` at once, in their order."""
        conditions = [each for each in (*wanted, *self._within(part)) if each is not None]
        return self._ordered(part, [*conditions, self._holds(part.text)]).limit(part.limit)

    def _rows(
        self, connection: Connection, part: ListPart, shown: list[ColumnElement[bool]]
    ) -> tuple[Sequence[Row[Any]], str | None]:
        """Of the part, and where the next one begins. One whose own place cannot be read is not its last."""
        statement = self._ordered(part, shown)
        if part.limit is None:
            return connection.execute(statement).all(), None
        count = part.limit
        while True:
            rows = connection.execute(statement.limit(count + 1)).all()
            if len(rows) <= count:
                return rows, None
            after = self._place(rows[count - 1])
            if after is not None:
                return rows[:count], after
            count += 1

    def _ordered(self, part: ListPart, shown: list[ColumnElement[bool]]) -> Select[Any]:
        columns = [self.table.c[name] for name in self.by]
        is_down = self.newest_first != part.reverse
        statement = select(self.table).where(*shown)
        if part.after:
            here, last = tuple_(*columns), tuple_(*self._values(part.after))
            statement = statement.where(here < last if is_down else here > last)
        return statement.order_by(*(column.desc() if is_down else column for column in columns))

    def _count(self, connection: Connection, conditions: Sequence[ColumnElement[bool]]) -> int:
        return connection.scalar(select(func.count()).select_from(self.table).where(*conditions)) or 0

    def _within(self, part: ListPart) -> list[ColumnElement[bool] | None]:
        at = self.table.c[self.by[0]]
        return [
            None if part.since is None else at >= part.since,
            None if part.until is None else at < part.until,
        ]

    def _place(self, row: Row[Any]) -> str | None:
        """None where it was overwritten."""
        values = [row._mapping[name] for name in self.by]
        if not all(isinstance(value, str | int | datetime) for value in values):
            return None
        place = BETWEEN.join(_text_of(value) for value in values)
        return place if place.isprintable() and len(place) <= LONGEST_PLACE else None

    def _values(self, place: str) -> list[Any]:
        parts = place.split(BETWEEN, len(self.by) - 1)
        kinds = [self.table.c[name].type for name in self.by]
        try:
            return [_value_of(part, kind) for part, kind in zip(parts, kinds, strict=True)]
        except ValueError as error:
            raise BadInput(
                f"after={place!r} is no place in this list; take it from the answer before, or leave it out"
            ) from error

    def _holds(self, text: str) -> ColumnElement[bool]:
        words = text.split()
        return and_(True, *(or_(*_found_in(self.table, self.searched, word)) for word in words))


def _text_of(value: Any) -> str:
    return value.astimezone(UTC).strftime("%Y%m%dT%H%M%S.%fZ") if isinstance(value, datetime) else str(value)


def _value_of(text: str, kind: Any) -> Any:
    """Raises ValueError."""
    if isinstance(kind, UtcTime):
        return datetime.strptime(text, "%Y%m%dT%H%M%S.%fZ").replace(tzinfo=UTC)
    return kind.python_type(text)


def _found_in(table: Table, searched: Sequence[str], word: str) -> list[ColumnElement[bool]]:
    is_short = len(word) < FEWEST_OF_AN_ID
    return [
        _found(table, name, word) for name in searched if not (is_short and name.startswith(AT_ITS_BEGINNING))
    ]


def _found(table: Table, name: str, word: str) -> ColumnElement[bool]:
    """Capitals or not, as far as the database knows them."""
    column, *keys = name.removeprefix(AT_ITS_BEGINNING).split(".")
    pattern = ("" if name.startswith(AT_ITS_BEGINNING) else "%") + _escaped(word) + "%"
    if not keys:
        return Alike(table.c[column], pattern)
    inside = Alike(TextIn(table.c[column], *keys), pattern)
    if not word.isascii():  # stored in another form
        return inside
    anywhere = Alike(TextIn(table.c[column]), f"%{_escaped(json_text(word)[1:-1])}%")
    return and_(anywhere, inside)  # few documents have it at all, and they alone are parsed


def _escaped(word: str) -> str:
    return "".join(f"/{each}" if each in "/%_" else each for each in word)


class Alike(FunctionElement[Any]):
    """``LIKE``, whatever the capitals; SQLite's is so, and twice as fast as what asks for it."""

    type = NullType()
    inherit_cache = True

    def __init__(self, text: ColumnElement[str], pattern: str) -> None:
        super().__init__(text, pattern)


@compiles(Alike)
def _alike_on_sqlite(element: Alike, compiler: Any, **options: Any) -> str:
    text, pattern = (compiler.process(each, **options) for each in element.clauses)
    return f"({text} LIKE {pattern} ESCAPE '/')"


@compiles(Alike, "postgresql")
def _alike_on_postgresql(element: Alike, compiler: Any, **options: Any) -> str:
    text, pattern = (compiler.process(each, **options) for each in element.clauses)
    return f"({text} ILIKE {pattern} ESCAPE '/')"


class TextIn(FunctionElement[str]):
    """What a JSON document holds under some keys, as text; NULL where it is nothing, or no JSON any more.
    Without keys the document as it is stored."""

    type = String()
    inherit_cache = True

    def __init__(self, column: ColumnElement[Any], *keys: str) -> None:
        super().__init__(column, ".".join(keys))


def is_of_hand_in(said: ColumnElement[str], hand: Handedness | None) -> ColumnElement[bool] | None:
    """``glovecal_models.hand.rotations.is_of_hand`` for a database."""
    others = [each for each in HANDS if each != hand]
    return None if hand is None else said.is_(None) | said.not_in(others)


@compiles(TextIn)
def _on_sqlite(element: TextIn, compiler: Any, **options: Any) -> str:
    column, keys = element.clauses
    document = compiler.process(column, **options)
    if not keys.value:
        return document
    return f"CASE WHEN json_valid({document}) THEN json_extract({document}, '$.{keys.value}') END"


@compiles(TextIn, "postgresql")
def _on_postgresql(element: TextIn, compiler: Any, **options: Any) -> str:
    column, keys = element.clauses
    if not keys.value:
        return f"({compiler.process(column, **options)})::text"
    return f"({compiler.process(column, **options)} #>> '{{{keys.value.replace('.', ',')}}}')"
