"""The log of changes, tampered with behind the service's back: every edit, deletion and swap is found."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from threading import Thread

import pytest

from glovecal_service.store import Store
from glovecal_service.store.tables import audit, audit_head

ENTRIES = 8


@pytest.fixture
def database(sqlite_store: Store) -> Iterator[sqlite3.Connection]:
    for number in range(ENTRIES):
        sqlite_store.subjects.create(f"s{number}", title=str(number))
    assert sqlite_store.database.file is not None
    with closing(sqlite3.connect(sqlite_store.database.file, isolation_level=None)) as connection:
        yield connection


def test_every_edit_deletion_and_swap_is_found(sqlite_store: Store, database: sqlite3.Connection) -> None:
    assert (sqlite_store.audit.problems(), sqlite_store.audit.count) == ([], ENTRIES)
    numbers = range(1, ENTRIES + 1)
    tampered = [f"DELETE FROM audit WHERE id = {number}" for number in numbers]
    tampered += [f"DELETE FROM audit WHERE id >= {number}" for number in numbers]
    for column in audit.columns:
        other = {"id": "id + 100", "at": "datetime(at, '+1 second')", "changes": "replace(changes, 's', 't')"}
        changed = other.get(column.name, f"{column.name} || 'x'")
        tampered += [f"UPDATE audit SET {column.name} = {changed} WHERE id = {number}" for number in numbers]
    for one in numbers:
        for another in range(one + 1, ENTRIES + 1):
            swapped = f"CASE id WHEN {one} THEN {another} WHEN {another} THEN {one} ELSE id END + 1000"
            tampered.append(f"UPDATE audit SET id = {swapped}; UPDATE audit SET id = id - 1000")
    tampered += [f"UPDATE audit_head SET {name} = {name} || '0'" for name in ("count", "sha256")]
    assert {"count", "sha256"} <= {column.name for column in audit_head.columns}
    unnoticed = []
    for statements in tampered:
        database.execute("CREATE TEMP TABLE kept AS SELECT * FROM audit")
        database.execute("CREATE TEMP TABLE kept_head AS SELECT * FROM audit_head")
        for statement in statements.split(";"):
            database.execute(statement)
        if not sqlite_store.audit.problems():
            unnoticed.append(statements)
        for table, kept in (("audit", "kept"), ("audit_head", "kept_head")):
            database.execute(f"DELETE FROM {table}")
            database.execute(f"INSERT INTO {table} SELECT * FROM {kept}")
            database.execute(f"DROP TABLE {kept}")
    assert unnoticed == []
    assert sqlite_store.audit.problems() == []


def test_a_log_that_grows_while_it_is_read_is_not_tampered_with(sqlite_store: Store) -> None:
    written = 40

    def write() -> None:
        for number in range(written):
            sqlite_store.subjects.create(f"s{number}")

    writer = Thread(target=write)
    writer.start()
    problems = []
    while writer.is_alive():
        problems += sqlite_store.audit.problems()
    writer.join()
    assert problems == []
    assert sqlite_store.audit.count == written
