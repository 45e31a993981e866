"""Layouts: the built-in ones and those that users stored."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from sqlalchemy import Connection, delete, exists, insert, select

from glovecal_models.errors import BadInput
from glovecal_models.layout import BUILT_IN, Layout
from glovecal_models.names import check_identifier, did_you_mean
from glovecal_service.store import tables
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.records import LayoutRecord
from glovecal_service.store.row_hash import sound_row, sound_rows


def no_layout(name: str, known: Iterable[str]) -> NotFound:
    """What is said of a layout that is neither built in nor stored."""
    return NotFound(f"there is no layout {name!r}; {did_you_mean(name, known)}")


class Layouts:
    def __init__(self, database: Database) -> None:
        self._database = database

    def get(self, name: str) -> Layout:
        """The layout of that name, stored or built in. Raises NotFound."""
        statement = select(tables.layouts).where(tables.layouts.c.name == name)
        with self._database.read() as connection:
            row = connection.execute(statement).one_or_none()
            stored = connection.scalars(select(tables.layouts.c.name)).all()
        if row is not None:
            return Layout.from_document(sound_row(tables.layouts, row)["document"])
        if name in BUILT_IN:
            return Layout.built_in(name)
        raise no_layout(name, [*BUILT_IN, *stored])

    def list(self) -> list[LayoutRecord]:
        """Built-in layouts first, then stored ones by name."""
        built_in = [LayoutRecord(name, Layout.built_in(name).to_document(), True) for name in BUILT_IN]
        statement = select(tables.layouts).order_by(tables.layouts.c.name)
        with self._database.read() as connection:
            return built_in + sound_rows(connection, tables.layouts, statement, _record)

    def put(self, layout: Layout) -> LayoutRecord:
        """Keep a layout; the same one again changes nothing.

        Raises BadInput for a bad name, Conflict if the name is a built-in one's, or belongs to a different
        layout that takes or models already use.
        """
        name, document = check_identifier(layout.name, "layout"), layout.to_document()
        if name in BUILT_IN:
            if document == Layout.built_in(name).to_document():
                return LayoutRecord(name, document, True)
            raise Conflict(f"layout {name!r} is built in; give yours another name")
        if Layout.from_document(document).to_document() != document:
            raise BadInput(
                f"layout {name!r} does not survive being written and read; its document is unsound"
            )
        record = LayoutRecord(name, document, False, now())
        with self._database.write() as connection:
            earlier = connection.execute(select(tables.layouts).where(tables.layouts.c.name == name)).first()
            if earlier is not None:
                record_before = _record(sound_row(tables.layouts, earlier))
                if record_before.document == document:
                    return record_before
            if _in_use(connection, name):
                raise Conflict(
                    f"takes or models use layout {name!r} as it is; give the changed one another name"
                )
            connection.execute(delete(tables.layouts).where(tables.layouts.c.name == name))
            connection.execute(
                insert(tables.layouts).values(name=name, document=document, created_at=record.created_at)
            )
        return record


def _record(values: Mapping[str, Any]) -> LayoutRecord:
    return LayoutRecord(**values, built_in=False)


def _in_use(connection: Connection, name: str) -> bool:
    used = [exists().where(table.c.layout == name) for table in (tables.takes, tables.models)]
    return any(connection.scalar(select(clause)) for clause in used)
