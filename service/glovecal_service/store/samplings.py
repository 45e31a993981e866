"""Guided samplings: the web process brings the user's events, the recorder process time and frames.

Both load the document, change it and save it with the version that they saw; who comes late loads it again.
So an event is answered with what it did, and a killed process loses nothing but the frames of one step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection, select

from glovecal_service.store import tables
from glovecal_service.store.changes import tell_change
from glovecal_service.store.database import Database, new_id, now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.list_part import Listing, ListPart, Page
from glovecal_service.store.records import SamplingRecord
from glovecal_service.store.row_hash import add_row, change_rows, sound_row, sound_rows
from glovecal_service.store.subjects import require_subject

_LISTING = Listing(
    tables.samplings, newest_first=True, searched=("^id", "glove", "subject", "wearing", "layout")
)


class Samplings:
    def __init__(self, database: Database) -> None:
        self._database = database

    def create(
        self,
        *,
        glove: str,
        subject: str,
        wearing: str,
        layout: str,
        document: Mapping[str, Any],
    ) -> SamplingRecord:
        """Raises NotFound (subject), Conflict while the glove is in another sampling."""
        id, at = new_id(), now()
        with self._database.write() as connection:
            require_subject(connection, subject)
            table = tables.samplings
            busy = select(table.c.id).where((table.c.glove == glove) & table.c.open)
            if other := connection.scalar(busy.limit(1)):
                raise Conflict(f"glove {glove!r} is in sampling {other} already; stop or resume that one")
            values = {
                "id": id,
                "glove": glove,
                "subject": subject,
                "wearing": wearing,
                "layout": layout,
                "open": True,
                "version": 1,
                "document": dict(document),
                "recordings": [],
                "takes": [],
                "live": {},
                "problem": "",
                "created_at": at,
                "updated_at": at,
            }
            add_row(connection, table, values)
            tell_change(connection, "sampling")
            return _require(connection, id)

    def get(self, id: str) -> SamplingRecord:
        """Raises NotFound."""
        with self._database.read() as connection:
            return _require(connection, id)

    def list(self, *, glove: str | None = None, only_open: bool = False) -> list[SamplingRecord]:
        """Newest first."""
        table = tables.samplings
        statement = _LISTING.every(
            None if glove is None else table.c.glove == glove, table.c.open if only_open else None
        )
        with self._database.read() as connection:
            return sound_rows(connection, table, statement, _record)

    def page(
        self, part: ListPart, *, glove: str | None = None, subject: str | None = None, only_open: bool = False
    ) -> Page[SamplingRecord]:
        """A part of them, newest first."""
        table = tables.samplings.c
        with self._database.read() as connection:
            return _LISTING.page(
                connection, _record, part,
                None if glove is None else table.glove == glove,
                None if subject is None else table.subject == subject,
                table.open if only_open else None,
            )  # fmt: skip

    def save(self, seen: SamplingRecord, document: Mapping[str, Any]) -> SamplingRecord | None:
        """Replace the document that ``seen`` has; None if somebody else did so meanwhile."""
        table = tables.samplings
        same = (table.c.id == seen.id) & (table.c.version == seen.version)
        values = {"document": dict(document), "version": seen.version + 1, "updated_at": now()}
        with self._database.write() as connection:
            if not change_rows(connection, table, same, values):
                return None
            tell_change(connection, "sampling")
            return _require(connection, seen.id)

    def note(self, id: str, **values: Any) -> None:
        """Set ``live``, ``problem``, ``recordings``, ``takes`` or ``open``; only its runner does so."""
        with self._database.write() as connection:
            change_rows(connection, tables.samplings, tables.samplings.c.id == id, values)


def _require(connection: Connection, id: str) -> SamplingRecord:
    row = connection.execute(select(tables.samplings).where(tables.samplings.c.id == id)).one_or_none()
    if row is None:
        raise NotFound(f"there is no sampling {id!r}. List them: glovecal sample list")
    return _record(sound_row(tables.samplings, row))


def _record(values: dict[str, Any]) -> SamplingRecord:
    return SamplingRecord(**values)
