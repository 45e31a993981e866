"""Is the database of the schema that this software wants? Migrates it when it is not."""

from __future__ import annotations

from importlib import resources
from importlib.resources.abc import Traversable

from sqlalchemy import Connection, inspect, text

from glovecal_service.store.database import Database
from glovecal_service.store.errors import StoreDamaged
from glovecal_service.store.tables import metadata


def upgrade(database: Database) -> None:
    """Upgrade to the newest schema in one transaction. Raises UnknownSchema, StorageFull, StoreDamaged.

    Alembic is imported only when there is something to do: every command of a user comes through here.
    """
    with database.read() as connection:
        if _present(connection) == newest_revision():
            if database.is_sqlite:
                _require_as_made(connection, database.name)
            return
    from glovecal_service.store.migrate import migrate

    migrate(database, migrations())


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


def _require_as_made(connection: Connection, name: str) -> None:
    """Raises StoreDamaged unless SQLite's file declares each table's columns as they were made.

    The declarations stand in the file as text. One changed letter of a type changes what is stored: where
    VARCHAR is no word any more, the id "12e456789012" is kept as the number infinity.
    """
    for table in metadata.sorted_tables:
        made = {
            (each.name, str(each.type.compile(connection.dialect)), not each.nullable, each.primary_key)
            for each in table.columns
        }
        there = {
            (row.name, row.type, bool(row.notnull), bool(row.pk))
            for row in connection.exec_driver_sql(f"PRAGMA table_info({table.name})")
        }
        changed = sorted({column for column, *_ in made ^ there})
        if changed:
            raise StoreDamaged(
                f"the database {name} is damaged: its table {table.name} was declared otherwise "
                f"({', '.join(map(ascii, changed))}); restore a backup of it"
            )
