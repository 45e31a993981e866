"""The connection to SQLite or PostgreSQL: how transactions begin, and what their failures mean.

SQLite (https://sqlite.org/wal.html, https://sqlite.org/pragma.html): write-ahead log so that readers
and one writer do not wait for each other; ``synchronous=FULL`` so that an acknowledged write survives a
power cut; ``BEGIN IMMEDIATE`` for writing so that a transaction waits for the lock at its start instead of
failing in its middle. Python's own transaction handling is switched off (``isolation_level=None``), or
schema changes would commit half-way.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url
from sqlalchemy.exc import (
    ArgumentError,
    DatabaseError,
    DataError,
    InterfaceError,
    NoSuchModuleError,
    OperationalError,
    StatementError,
)

from glovecal_client.installation import not_installed
from glovecal_models.errors import BadInput
from glovecal_service.store.errors import StorageFull, StoreDamaged, StoreUnavailable
from glovecal_service.store.json_text import json_text

BUSY_TIMEOUT_MS = 5000
_DAMAGED = ("malformed", "not a database", "unsupported file format", "no such table", "no such column")
"""SQLite's words; the schema was looked at when the store was opened, so a table that is gone is damage."""
_DAMAGED_STATES = ("XX001", "XX002")
"""PostgreSQL's data_corrupted and index_corrupted."""
_SQLITE_ENDS = ("", "-wal", "-shm", "-journal")


class Database:
    """Opens transactions; translates the drivers' errors into those of the store."""

    def __init__(self, url: str | URL) -> None:
        """Raises BadInput if the URL is not one of SQLite or PostgreSQL (through psycopg 3)."""
        self.engine = _engine(url)
        self.is_sqlite = self.engine.dialect.name == "sqlite"
        self._writing = self.engine.execution_options(glovecal_begin="BEGIN IMMEDIATE")

    @property
    def file(self) -> Path | None:
        """The SQLite file, None for a server or a database in memory."""
        name = self.engine.url.database
        return Path(name) if self.is_sqlite and name and name != ":memory:" else None

    @property
    def files(self) -> list[Path]:
        """The SQLite file and those that SQLite keeps beside it, whether or not they are there now."""
        file = self.file
        return [] if file is None else [file.with_name(file.name + end) for end in _SQLITE_ENDS]

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A transaction that sees one state of the database and changes nothing."""
        with self._translated(), self.engine.begin() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction that is kept whole or not at all."""
        with self._translated(), self._writing.begin() as connection:
            yield connection

    def close(self) -> None:
        self.engine.dispose()

    @contextmanager
    def _translated(self) -> Iterator[None]:
        try:
            yield
        except DatabaseError as error:
            raise _meaning(error, self) from error
        except UnicodeEncodeError as error:
            raise BadInput(f"{error.object!r} is not text that can be stored") from error
        except InterfaceError as error:
            raise StoreUnavailable(f"the database {self.name} cannot be used: {error.orig}") from error
        except StatementError as error:
            if isinstance(error.orig, BadInput):
                raise error.orig from None
            if isinstance(error.orig, ValueError | TypeError | UnicodeError):
                raise BadInput(f"a value cannot be stored: {error.orig}") from error
            raise

    @property
    def name(self) -> str:
        """The URL without its password, for messages."""
        return self.engine.url.render_as_string(hide_password=True)


def _engine(url: str | URL) -> Engine:
    try:
        parsed = make_url(url)
        if parsed.drivername in ("postgresql", "postgres"):
            parsed = parsed.set(drivername="postgresql+psycopg")
        if parsed.drivername not in ("sqlite", "sqlite+pysqlite", "postgresql+psycopg"):
            raise ArgumentError(f"driver {parsed.drivername!r} is not supported")
        engine = create_engine(parsed, pool_pre_ping=True, json_serializer=json_text, max_overflow=40)
    except ModuleNotFoundError as error:
        raise BadInput(not_installed("GLOVECAL_DATABASE with PostgreSQL", "psycopg[binary]")) from error
    except (ArgumentError, NoSuchModuleError) as error:
        raise BadInput(
            f"GLOVECAL_DATABASE: {error}; use sqlite:///FILE or postgresql+psycopg://USER@HOST/DATABASE"
        ) from error
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _configure_sqlite)
        event.listen(engine, "begin", _begin_sqlite)
    return engine


def _configure_sqlite(connection: sqlite3.Connection, _record: object) -> None:
    connection.isolation_level = None
    # text that is no UTF-8 any more is noticed by its row's hash instead of failing the whole statement
    connection.text_factory = lambda content: content.decode("utf-8", "surrogateescape")
    cursor = connection.cursor()
    cursor.execute(f"PRAGMA busy_timeout = {BUSY_TIMEOUT_MS}")
    _switch_to_write_ahead_log(cursor)
    cursor.execute("PRAGMA synchronous = FULL")
    cursor.execute("PRAGMA foreign_keys = ON")
    cursor.close()


def _switch_to_write_ahead_log(cursor: sqlite3.Cursor) -> None:
    """SQLite does not wait, whatever its busy timeout, while another process switches a new file over."""
    deadline = time.monotonic() + BUSY_TIMEOUT_MS / 1000
    while True:
        try:
            cursor.execute("PRAGMA journal_mode = WAL")
            return
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or time.monotonic() > deadline:
                raise
            time.sleep(0.01)


def _begin_sqlite(connection: Connection) -> None:
    connection.exec_driver_sql(connection.get_execution_options().get("glovecal_begin", "BEGIN"))


def _meaning(error: DatabaseError, database: Database) -> Exception:
    name = database.name
    text = str(error.orig)
    if "disk is full" in text or getattr(error.orig, "sqlstate", None) == "53100":
        return StorageFull(f"no room left for the database {name}; nothing was changed: free some disk space")
    if isinstance(error, DataError):
        return BadInput(f"a value cannot be stored: {text.strip()}")
    if any(words in text for words in _DAMAGED) or getattr(error.orig, "sqlstate", None) in _DAMAGED_STATES:
        return StoreDamaged(f"the database {name} is damaged ({text}); restore a backup of it")
    if isinstance(error, OperationalError):
        return StoreUnavailable(f"the database {name} does not answer now: {text.strip()}")
    return error
