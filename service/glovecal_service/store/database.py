"""The connection to SQLite or PostgreSQL: how transactions begin, and what their failures mean.

SQLite (https://sqlite.org/wal.html, https://sqlite.org/pragma.html): write-ahead log so that readers
and one writer do not wait for each other; ``synchronous=FULL`` so that an acknowledged write survives a
power cut; ``BEGIN IMMEDIATE`` for writing so that a transaction waits for the lock at its start instead of
failing in its middle. Python's own transaction handling is switched off (``isolation_level=None``), or
schema changes would commit half-way.

Here too: the time and the identifiers that rows get.
"""

from __future__ import annotations

import logging
import secrets
import shutil
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from copy import copy
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url
from sqlalchemy.exc import (
    ArgumentError,
    DatabaseError,
    DataError,
    IntegrityError,
    InterfaceError,
    NoSuchModuleError,
    StatementError,
)
from sqlalchemy.pool import ConnectionPoolEntry

from glovecal_client.installation import not_installed
from glovecal_models.errors import BadInput
from glovecal_service.logs import Word
from glovecal_service.store.actor import OPTION, Actor
from glovecal_service.store.audit_trail import watch_changes, written_down
from glovecal_service.store.errors import StorageFull, StoreDamaged, StoreUnavailable
from glovecal_service.store.scope import narrow_statements
from glovecal_service.store.server_watch import watched_connections
from glovecal_service.store.texts import json_text


def now() -> datetime:
    return datetime.now(UTC)


def new_id() -> str:
    """A short random identifier: 48 bits, hexadecimal."""
    return secrets.token_hex(6)


log = logging.getLogger("glovecal.store")
BUSY_TIMEOUT_MS = 5000
CONNECTED_WITHIN_S = 3
"""With a server, in whole seconds; without it a network that swallows packets holds a request for minutes."""
LEAST_ROOM_BYTES = 1 << 20
"""With less the disk is called full where SQLite speaks of an I/O error: its shared memory grows by 32 kB."""
UNSTORABLE = (
    "a value cannot be stored: text must be without NUL and surrogates, whole numbers must fit 64 bits, "
    "other numbers must be finite"
)
_FULL = ("SQLITE_FULL", "53100")
_DAMAGED = (
    *("SQLITE_CORRUPT", "SQLITE_NOTADB", "SQLITE_ERROR", "SQLITE_MISMATCH", "SQLITE_SCHEMA", "SQLITE_FORMAT"),
    *("XX001", "XX002", "42"),
)
"""Beginnings of codes. Our statements are right and the schema was looked at when the store was opened, so
what SQLite calls an error of a statement, or PostgreSQL one of its class 42, is a table that is not what was
made. XX001 and XX002: data_corrupted and index_corrupted."""
_NOT_ALLOWED = ("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM", "SQLITE_AUTH")
_SQLITE_ENDS = ("", "-wal", "-shm", "-journal")


class Database:
    """Opens transactions; translates the drivers' errors into those of the store."""

    def __init__(self, url: str | URL) -> None:
        """Raises BadInput if the URL is not one of SQLite or PostgreSQL (through psycopg 3)."""
        self.engine = _engine(url)
        self.is_sqlite = self.engine.dialect.name == "sqlite"
        what = f"the database {self.name}"
        self._watched = nullcontext if self.is_sqlite else watched_connections(self.engine, what).waiting
        narrow_statements(self.engine)
        watch_changes(self.engine)
        self._writing = self.engine.execution_options(glovecal_begin="BEGIN IMMEDIATE")

    def acting_as(self, actor: Actor) -> Database:
        """The same database, asked by somebody: it is narrowed to what they see, and changes are theirs."""
        bound = copy(self)
        bound.engine = self.engine.execution_options(**{OPTION: actor})
        bound._writing = self._writing.execution_options(**{OPTION: actor})
        return bound

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
        with self._translated(), self._watched(), self.engine.begin() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction that is kept whole or not at all."""
        with (
            self._translated(),
            self._watched(),
            self._writing.begin() as connection,
            written_down(connection),
        ):
            yield connection

    def close(self) -> None:
        """A connection that some thread still uses is closed when it gives it back."""
        event.listen(self.engine, "checkin", _close_late)
        self.engine.dispose()

    def forget_deleted_rows(self) -> bool:
        """Write an SQLite file anew, without what deleted and earlier rows left in it and in its log; whether
        that was possible now. A server does so by itself, in its own time."""
        if not self.is_sqlite:
            return True
        try:
            with closing(self.engine.raw_connection()) as connection:
                cursor = connection.cursor()
                cursor.execute("VACUUM")
                is_busy, *_ = cursor.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
                return not is_busy
        except sqlite3.Error as error:
            log.info("database %s cannot be written anew now: %s", self.name, error)
            return False

    @contextmanager
    def _translated(self) -> Iterator[None]:
        try:
            yield
        except DatabaseError as error:
            raise _meaning(error, self) from error
        except (UnicodeEncodeError, OverflowError) as error:
            raise BadInput(UNSTORABLE) from error
        except InterfaceError as error:
            log.info("database %s cannot be used: %s", self.name, str(error.orig).strip())
            raise StoreUnavailable(
                f"the database {self.name} cannot be used now; the log has what its driver said"
            ) from error
        except StatementError as error:
            if isinstance(error.orig, BadInput):
                raise error.orig from None
            if isinstance(error.orig, ValueError | TypeError | UnicodeError):
                raise BadInput(UNSTORABLE) from error
            raise

    @property
    def name(self) -> str:
        """The URL without its password and its driver, for messages."""
        url = self.engine.url
        return url.set(drivername=url.get_backend_name()).render_as_string(hide_password=True)


def _engine(url: str | URL) -> Engine:
    try:
        parsed = make_url(url)
        if parsed.drivername in ("postgresql", "postgres"):
            parsed = parsed.set(drivername="postgresql+psycopg")
        if parsed.drivername not in ("sqlite", "sqlite+pysqlite", "postgresql+psycopg"):
            raise ArgumentError(f"driver {parsed.drivername!r} is not supported")
        options = {} if parsed.get_backend_name() == "sqlite" else {"connect_timeout": CONNECTED_WITHIN_S}
        engine = create_engine(
            parsed, pool_pre_ping=True, json_serializer=json_text, max_overflow=40, connect_args=options
        )
    except ModuleNotFoundError as error:
        raise BadInput(not_installed("GLOVECAL_DATABASE with PostgreSQL", "psycopg[binary]")) from error
    except (ArgumentError, NoSuchModuleError) as error:
        raise BadInput(
            "GLOVECAL_DATABASE is no address of SQLite or PostgreSQL; use sqlite:///FILE or "
            "postgresql+psycopg://USER@HOST/DATABASE"
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


def _close_late(_connection: object, record: ConnectionPoolEntry) -> None:
    record.invalidate()


def _begin_sqlite(connection: Connection) -> None:
    connection.exec_driver_sql(connection.get_execution_options().get("glovecal_begin", "BEGIN"))


def _meaning(error: DatabaseError, database: Database) -> Exception:
    """The store's error; the driver's own text goes to the log only."""
    name, code = database.name, _code(error)
    log.info("database %s refused (%s): %s", name, Word(code), str(error.orig).strip())
    if code in _FULL or (code.startswith("SQLITE_IOERR") and _disk_is_full(database)):
        return StorageFull(f"no room left for the database {name}; nothing was changed: free some disk space")
    if isinstance(error, DataError):
        return BadInput(UNSTORABLE)
    if code.startswith(_DAMAGED):
        return StoreDamaged(f"the database {name} is damaged ({code}); restore a backup of it")
    if code.startswith("SQLITE_IOERR"):
        return StoreUnavailable(f"the disk of the database {name} fails ({code}); look at it, try again")
    if code.startswith(_NOT_ALLOWED):
        return StoreUnavailable(
            f"the database {name} cannot be opened and written ({code}); look at its folder's permissions"
        )
    if code.startswith("SQLITE_BUSY"):
        return StoreUnavailable(
            f"the database {name} does not answer now: other programs were writing for "
            f"{BUSY_TIMEOUT_MS / 1000:g} s; try again"
        )
    if isinstance(error, IntegrityError):
        return error  # says that a name is taken, to who asked for it
    said = f" ({code})" if code.isupper() or code.isdigit() else ""  # else the driver's word
    return StoreUnavailable(
        f"the database {name} does not answer now{said}; is it running, may this user log in, and is the "
        "address right? The log has what it said"
    )


def _code(error: DatabaseError) -> str:
    """SQLite's name of the error, such as ``SQLITE_BUSY``, or PostgreSQL's five letters."""
    return (
        getattr(error.orig, "sqlite_errorname", None)
        or getattr(error.orig, "sqlstate", None)
        or type(error.orig).__name__
    )


def _disk_is_full(database: Database) -> bool:
    """SQLite has no other word than I/O error where it cannot make its shared memory larger."""
    if database.file is None:
        return False
    try:
        return shutil.disk_usage(database.file.parent).free < LEAST_ROOM_BYTES
    except OSError:
        return False
