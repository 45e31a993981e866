"""What is damaged, as a slow search through every row and artifact finds it: named once, never changed.

The search is the only one that reads everything; who wants to know whether all is well reads what it found.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, Row, Table, delete, func, insert, literal_column, select
from sqlalchemy import and_ as sql_and
from sqlalchemy import tuple_ as sql_tuple

from glovecal_models.errors import DamagedArtifact
from glovecal_service.store import tables
from glovecal_service.store.blobs import Artifacts
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import NotFound, StoreDamaged
from glovecal_service.store.models import Models
from glovecal_service.store.row_hash import HASH, sound_row

AT_ONCE = 50
"""Rows that are looked at between two pauses."""
PROTECTED = tuple(table for table in tables.metadata.sorted_tables if HASH in table.columns)
MOST_AGAIN = 1000
"""Damaged things that are looked at again between two searches."""
LONGEST_KEY, LONGEST_SENTENCE = 200, 2000
INDEX = "(index)"
"""Stands for the key of a row: lists find rows by indices."""
_PLAIN_KEY = re.compile(r"[0-9A-Za-z._/-]+")
"""Another one was overwritten: no row can be looked up by it."""


@dataclass(frozen=True)
class Damage:
    table: str
    id: str
    """The row's key; of several columns with a slash between them."""
    sentence: str
    """What it is, and what to do."""
    found_at: datetime


class Damages:
    """Of rows, and of the artifacts that rows of takes and models name."""

    def __init__(self, database: Database, artifacts: Artifacts, models: Models) -> None:
        self._database = database
        self._artifacts = artifacts
        self._models = models

    def list(self, *, limit: int) -> tuple[list[Damage], int]:
        """The first that were found, and how many there are in all."""
        table = tables.damages
        total = func.count().over().label("total")
        statement = select(table, total).order_by(table.c.found_at, table.c.table, table.c.id).limit(limit)
        with self._database.read() as connection:
            rows = connection.execute(statement).all()
        return [Damage(row.table, row.id, str(row.sentence), row.found_at) for row in rows], (
            rows[0].total if rows else 0
        )

    def of_models(self, ids: Sequence[str]) -> dict[str, str]:
        """Sentences on those that are known to be damaged."""
        table = tables.damages
        mine = (table.c.table == tables.models.name) & table.c.id.in_(ids)
        with self._database.read() as connection:
            return {row.id: str(row.sentence) for row in connection.execute(select(table).where(mine))}

    def note(self, table: str, id: str, sentence: str, subject: str | None = None) -> bool:
        """Remember that it is damaged; whether that is new."""
        damages = tables.damages
        known = (damages.c.table == table) & (damages.c.id == id[:LONGEST_KEY])
        with self._database.write() as connection:
            before = connection.scalar(select(damages.c.sentence).where(known))
            if before == sentence[:LONGEST_SENTENCE]:
                return False
            connection.execute(delete(damages).where(known))
            values = {"table": table, "id": id[:LONGEST_KEY], "sentence": sentence[:LONGEST_SENTENCE]}
            connection.execute(insert(damages).values(**values, subject=subject, found_at=now()))
            return before is None

    def look_again(self) -> None:
        """At what is known to be damaged: what is sound again, or gone, is forgotten. Raises StoreError."""
        known, _ = self.list(limit=MOST_AGAIN)
        for damage in known:
            table = tables.metadata.tables[damage.table]
            if _PLAIN_KEY.fullmatch(damage.id):
                with self._database.read() as connection:
                    row = connection.execute(select(table).where(_is_key(table, damage.id))).one_or_none()
                if row is None or not self._sentence(table, row):
                    self._forget(table, lambda id, gone=damage.id: id == gone)

    def search(self) -> Iterator[list[Damage]]:
        """Look at every row and artifact, some at each step: what was found there and was not known. Raises
        StoreError."""
        for table in PROTECTED:
            met: set[str] = set()
            for rows in self._parts(table):
                damages = []
                for row in rows:
                    if sentence := self._sentence(table, row):
                        id = _key(table, row)
                        met.add(id)
                        subject = row._mapping.get("subject")
                        subject = subject if isinstance(subject, str) and subject.isprintable() else None
                        if self.note(table.name, id, sentence, subject):
                            damages.append(Damage(table.name, id, sentence, now()))
                yield damages
            if sentence := self._damaged_index(table):
                met.add(INDEX)
                if self.note(table.name, INDEX, sentence):
                    yield [Damage(table.name, INDEX, sentence, now())]
            self._forget(table, lambda id, met=met: id not in met)

    def _parts(self, table: Table) -> Iterator[Sequence[Row[Any]]]:
        """In the order in which rows lie there, whatever their keys hold now."""
        is_sqlite = self._database.is_sqlite
        place: Any = literal_column("rowid") if is_sqlite else sql_tuple(*table.primary_key.columns)
        keys = [literal_column("rowid")] if is_sqlite else list(table.primary_key.columns)
        last: Any = None
        while True:
            with self._database.read() as connection:
                after = [] if last is None else [place > last]
                places = connection.execute(
                    select(*keys).select_from(table).where(*after).order_by(*keys).limit(AT_ONCE)
                ).all()
                if not places:
                    return
                end = places[-1][0] if is_sqlite else sql_tuple(*places[-1])
                rows = connection.execute(select(table).where(*after, place <= end)).all()
            last = end
            yield rows

    def _damaged_index(self, table: Table) -> str:
        """ "" where SQLite finds each row by each index of the table; a server looks after its own."""
        if not self._database.is_sqlite:
            return ""
        with self._database.read() as connection:
            problem = str(connection.exec_driver_sql(f"PRAGMA integrity_check({table.name})").scalar())
        if problem == "ok":
            return ""
        return (
            f"table {table.name} or an index of it is damaged ({problem}); restore a backup of the database"
        )

    def _sentence(self, table: Table, row: Row[Any]) -> str:
        """ "" for what is sound."""
        try:
            values = sound_row(table, row)
        except StoreDamaged as error:
            return str(error)
        if table is tables.models:
            return self._models.damage_of(values)
        if table is tables.takes:
            try:
                self._artifacts.get(values["artifact"])
            except (DamagedArtifact, NotFound) as error:
                return f"take {values['name']} ({values['id']}) cannot be loaded: {error}"
        return ""

    def _forget(self, table: Table, is_over: Callable[[str], bool]) -> None:
        damages = tables.damages
        mine = damages.c.table == table.name
        with self._database.read() as connection:
            ids = connection.scalars(select(damages.c.id).where(mine)).all()
        over = [id for id in ids if is_over(id)]
        if over:
            with self._database.write() as connection:
                connection.execute(delete(damages).where(mine & damages.c.id.in_(over)))


def forget_damages_of(connection: Connection, subject: str) -> None:
    """Sentences name who is erased."""
    connection.execute(delete(tables.damages).where(tables.damages.c.subject == subject))


def _key(table: Table, row: Row[Any]) -> str:
    values = [row._mapping[column.name] for column in table.primary_key.columns]
    plain = "/".join(str(value) for value in values)
    return plain if _PLAIN_KEY.fullmatch(plain) else ascii(plain)[:LONGEST_KEY]


def _is_key(table: Table, key: str) -> ColumnElement[bool]:
    columns = list(table.primary_key.columns)
    parts = key.split("/", len(columns) - 1)
    given = [column.type.python_type(part) for column, part in zip(columns, parts, strict=False)]
    if len(given) != len(columns):
        return columns[0].is_(None)
    same = [column == value for column, value in zip(columns, given, strict=True)]
    return sql_and(*same)
