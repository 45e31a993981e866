"""Changed rows: every change is noticed when the row is read, named, and never hidden by a later write."""

from __future__ import annotations

import random
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from filled_store import META, PROTECTED, fill, read_all
from sqlalchemy import text
from stored_takes import LAYOUT

from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.errors import DamagedRows, StoreDamaged
from glovecal_service.store.tables import metadata

COLUMNS = [
    (table, column.name)
    for table in PROTECTED
    for column in metadata.tables[table].columns
    if column is not metadata.tables[table].autoincrement_column
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A filled SQLite file, all of it in one file."""
    settings = Settings(data=tmp_path_factory.mktemp("whole"), database=None, artifacts=None)
    with Store.open(settings) as store:
        fill(store)
    file = settings.data / "glovecal.sqlite3"
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return file


@pytest.fixture
def copied(whole: Path, tmp_path: Path) -> Settings:
    shutil.copytree(whole.parent, tmp_path / "data", ignore=shutil.ignore_patterns("*-wal", "*-shm"))
    return Settings(data=tmp_path / "data", database=None, artifacts=None)


@pytest.fixture
def opened(copied: Settings) -> Iterator[Store]:
    with Store.open(copied) as store:
        yield store


def damage(store: Store, statement: str, value: Any = None) -> None:
    assert store.database.file is not None
    with closing(sqlite3.connect(store.database.file)) as connection:
        changed = connection.execute(statement, () if value is None else (value,)).rowcount
        connection.commit()
    assert changed == 1


@pytest.mark.parametrize(("table", "column"), COLUMNS)
def test_a_change_of_any_column_is_noticed_and_names_table_and_row(opened, table, column):
    """Damaged one way after another: other text, no UTF-8, bytes, another number, nothing."""
    assert opened.database.file is not None
    key = next(iter(metadata.tables[table].primary_key.columns)).name
    with closing(sqlite3.connect(opened.database.file)) as connection:
        found = f"SELECT rowid, {key}, {column} FROM {table} ORDER BY rowid LIMIT 1"
        rowid, named, before = connection.execute(found).fetchone()
    nullable = metadata.tables[table].columns[column].nullable
    ways: list[Any] = [
        "{",
        "ben",
        b"\xff\x00",
        77,
        77.5,
        *([None] if nullable and before is not None else []),
    ]
    if isinstance(before, str):
        other = before.replace("2", "3").replace("e", "f")
        ways += [before + "x", *([other] if other != before else [])]
    same = f"UPDATE {table} SET {column} = ? WHERE rowid = {rowid}"
    for value in ways:
        with closing(sqlite3.connect(opened.database.file)) as connection:
            connection.execute(same, (value,))
            connection.commit()
        with pytest.raises(StoreDamaged, match=f"of table {table}") as raised:
            read_all(opened)
        if column != key:
            assert str(named)[:80] in str(raised.value), f"{column} = {value!r}"
        with closing(sqlite3.connect(opened.database.file)) as connection:
            connection.execute(same, (before,))
            connection.commit()
    read_all(opened)


def test_forty_of_forty_overwrites_of_rows_are_noticed(whole, tmp_path):
    """1 to 64 random bytes over the content of a random row, as it lies in the file."""
    choose = random.Random(5)
    content = whole.read_bytes()
    places = [place for place in _row_places(whole, content) if place is not None]
    assert len(places) >= 15
    (tmp_path / "data").mkdir()
    settings = Settings(data=tmp_path / "data", database=None, artifacts=None)
    shutil.copytree(whole.parent / "artifacts", settings.artifacts_folder)
    file = settings.data / whole.name
    noticed = []
    for number in range(40):
        start, end = choose.choice(places)
        at = choose.randrange(start, end)
        length = min(choose.choice((1, 4, 16, 64)), end - at)
        new = bytes(byte ^ choose.randrange(1, 256) for byte in content[at : at + length])
        for suffix in ("-wal", "-shm"):
            file.with_name(file.name + suffix).unlink(missing_ok=True)
        file.write_bytes(content[:at] + new + content[at + length :])
        try:
            with Store.open(settings) as store:
                read_all(store)  # may read a column from an index, where it is what was written
                noticed += [(number, one.sentence) for found in store.damages.search() for one in found][:1]
        except StoreDamaged as error:
            noticed.append((number, str(error)))
    assert len(noticed) == 40


def _row_places(whole: Path, content: bytes) -> Iterator[tuple[int, int] | None]:
    """Where the hashed text of each protected row lies in the file: from its first text to its hash."""
    with closing(sqlite3.connect(whole)) as connection:
        for table in PROTECTED:
            for (digest,) in connection.execute(f"SELECT row_sha256 FROM {table}"):
                assert content.count(digest.encode()) == 1
                at = content.index(digest.encode())
                yield at - 60, at + 64


def test_lists_hold_the_sound_rows_and_name_the_damaged(opened):
    sound = opened.jobs.list()
    damage(opened, "UPDATE jobs SET payload = '{' WHERE id = ?", sound[0].id)
    with pytest.raises(DamagedRows) as raised:
        opened.jobs.list()
    assert raised.value.sound == sound[1:]
    assert raised.value.damaged == [
        f"row '{sound[0].id}' of table jobs is damaged: payload holds '{{'; restore a backup of the database"
    ]


def test_no_write_hides_a_damaged_row(opened):
    recording = opened.recordings.list(only_open=True)[0]
    take = opened.takes.list()[0]
    damage(opened, "UPDATE recordings SET wearing = 'other' WHERE id = ?", recording.id)
    damage(opened, "UPDATE takes SET wearing = 'other' WHERE id = ?", take.id)
    for write in (
        lambda: opened.recordings.update(recording.id, state="recording", sent=3),
        lambda: opened.takes.use_layout(take.id, LAYOUT),
        lambda: opened.takes.attach_reference(take.id, [0.0], ["I_MCP"], [[1.0]]),
    ):
        with pytest.raises(StoreDamaged, match="was changed after it was written"):
            write()
    assert opened.samplings.list(), "other tables are not concerned"


def test_a_damaged_job_holds_up_no_other(opened):
    (queued,) = opened.jobs.list(only_unfinished=True)
    damage(opened, "UPDATE jobs SET kind = 'improve' WHERE id = ?", queued.id)
    assert opened.jobs.claim("worker") is None
    later = opened.jobs.create("count", {})
    claimed = opened.jobs.claim("worker")
    assert claimed is not None
    assert claimed.id == later.id
    damage(opened, "UPDATE jobs SET lease_until = 0.0 WHERE id = ?", later.id)
    assert opened.jobs.claim("worker") is None


def test_what_is_stored_otherwise_than_given_is_no_damage(store):
    """Whole numbers in a column of seconds, other time zones, tuples, keys that are numbers."""
    fill(store)
    before = read_all(store)
    assert read_all(store) == before
    job = store.jobs.create("train", {"order": (10, 9), "by": {10: 1, 9: 2}, "t": 1e-7, "name": "\ud800é"})
    claimed = store.jobs.claim("w")
    while claimed is not None and claimed.id != job.id:
        claimed = store.jobs.claim("w")
    assert store.jobs.progress(job.id, 1, 1, "half", {"n": 3}).payload["by"] == {"10": 1, "9": 2}
    store.gloves.seen("left", META)


def test_a_changed_row_of_postgresql_is_noticed(store):
    fill(store)
    with store.database.write() as connection:
        connection.execute(text("UPDATE samplings SET version = version + 1"))
    with pytest.raises(StoreDamaged, match="of table samplings was changed after it was written"):
        store.samplings.list()
