"""Brings a database to the schema of this software with Alembic; an SQLite file is backed up first."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from importlib.resources.abc import Traversable
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, text

from glovecal_service.store.blobs import full_disk_named
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import StoreError

FIRST = "0007"
"""The schema that the first migration makes."""
ADVISORY_LOCK = 0x676C6F7665
"""Two services that start at once on one PostgreSQL upgrade it one after the other."""


class UnknownSchema(StoreError):
    """A newer Glovecal wrote the database, or one before the first release; nothing was changed."""


def migrate(database: Database, scripts: Traversable) -> None:
    """Upgrade to the newest schema of ``scripts`` in one transaction. Raises UnknownSchema, StorageFull,
    StoreDamaged."""
    config = _config(scripts)
    known = ScriptDirectory.from_config(config)
    newest = known.get_current_head()
    with database.read() as connection:
        present = _present(connection)
    if present == newest:
        return
    _refuse_unknown(known, present, database)
    if present is not None and database.file is not None:
        backup(database.file, database.file.with_name(f"{database.file.name}.before-{newest}"))
    with database.write() as connection:
        if not database.is_sqlite:
            connection.execute(text(f"SELECT pg_advisory_xact_lock({ADVISORY_LOCK})"))
        _refuse_unknown(known, _present(connection), database)
        config.attributes["connection"] = connection
        command.upgrade(config, "head")


def backup(source: Path, target: Path) -> None:
    """Copy an SQLite file that may be in use (https://sqlite.org/backup.html). Raises StorageFull."""
    if target.exists():
        target = target.with_name(f"{target.name}-{now():%Y%m%dT%H%M%S%f}")
    with (
        full_disk_named(target.parent),
        closing(sqlite3.connect(source)) as original,
        closing(sqlite3.connect(target)) as copy,
    ):
        original.backup(copy)


def _config(scripts: Traversable) -> Config:
    config = Config()
    config.set_main_option("script_location", str(scripts).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    return config


def _present(connection: Connection) -> str | None:
    return MigrationContext.configure(connection).get_current_revision()


def _refuse_unknown(known: ScriptDirectory, present: str | None, database: Database) -> None:
    if present is None or present in {script.revision for script in known.walk_revisions()}:
        return
    if present < FIRST:
        raise UnknownSchema(
            f"the database {database.name} has schema {present!r}, of a version before the first release, "
            "which is not upgraded; install the version that wrote it and export its models and takes there, "
            "or name another folder with GLOVECAL_DATA"
        )
    raise UnknownSchema(
        f"the database {database.name} has schema {present!r}, which this version of Glovecal does not know"
        f" (its newest is {known.get_current_head()!r}); install the newer Glovecal that wrote it, or restore"
        " a backup"
    )
