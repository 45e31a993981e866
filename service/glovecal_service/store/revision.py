"""A number that grows whenever the real-time process has something to look at."""

from __future__ import annotations

from sqlalchemy import Connection, select, update

from glovecal_service.store import tables
from glovecal_service.store.database import Database
from glovecal_service.store.errors import StoreDamaged


def grow(connection: Connection) -> int:
    """Add one inside the caller's transaction.

    The row is locked until that transaction ends, so whatever else grows the revision is done one after
    the other on PostgreSQL too.
    """
    statement = update(tables.revision).values(value=tables.revision.c.value + 1)
    value = connection.scalar(statement.returning(tables.revision.c.value))
    if value is None:
        raise StoreDamaged("the revision of the store is missing; restore a backup of the database")
    return int(value)


class Revision:
    """Reads the number; cheap enough to poll ten times a second."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def __call__(self) -> int:
        with self._database.read() as connection:
            value = connection.scalar(select(tables.revision.c.value))
        if not isinstance(value, int):
            raise StoreDamaged("the revision of the store is missing; restore a backup of the database")
        return value
