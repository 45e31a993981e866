"""Is the database of the schema that this software wants? Migrates it when it is not."""

from __future__ import annotations

from importlib import resources
from importlib.resources.abc import Traversable

from sqlalchemy import Connection, inspect, text

from glovecal_service.store.database import Database


def upgrade(database: Database) -> None:
    """Upgrade to the newest schema in one transaction. Raises NewerSchema, StorageFull, StoreDamaged.

    Alembic is imported only when there is something to do: every command of a user comes through here.
    """
    with database.read() as connection:
        if _present(connection) == newest_revision():
            return
    from glovecal_service.store.migrate import migrate

    migrate(database)


def newest_revision() -> str:
    """A migration's file is named after its revision: ``0001_first_schema.py``."""
    files = [entry.name for entry in (migrations() / "versions").iterdir() if entry.name.endswith(".py")]
    return max(name.partition("_")[0] for name in files)


def migrations() -> Traversable:
    """The folder of Alembic's scripts."""
    return resources.files("glovecal_service.store") / "migrations"


def _present(connection: Connection) -> str | None:
    if not inspect(connection).has_table("alembic_version"):
        return None
    return connection.scalar(text("SELECT version_num FROM alembic_version"))
