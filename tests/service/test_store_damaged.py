"""Full disks and damaged databases: said by name, nothing half written, reading goes on."""

import os
import sqlite3
from contextlib import closing, suppress
from pathlib import Path

import pytest
from stored_takes import LAYOUT, make_take

from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.errors import StorageFull, StoreDamaged, StoreError


@pytest.fixture
def small_disk(tmp_path, mount_small_disk):
    folder = tmp_path / "small"
    folder.mkdir()
    mount_small_disk(folder, "3m")
    return folder


def fill(file: Path) -> None:
    with suppress(OSError), file.open("wb", buffering=0) as filler:
        while True:
            filler.write(b"\0" * 512)


def create_many_subjects(store: Store) -> None:
    for number in range(1000):
        store.subjects.create(f"s{number}")


def test_a_full_disk_is_said_and_survived(small_disk):
    filler = small_disk / "filler"
    with Store.open(Settings(data=small_disk / "data", database=None, artifacts=None)) as store:
        store.subjects.create("anna")
        kept = store.takes.add(make_take(0), subject="anna", layout=LAYOUT.name, source="import")
        with pytest.raises(StorageFull, match="no room left in"):
            store.takes.add(make_take(1, frames=160_000), subject="anna", layout=LAYOUT.name, source="import")
        fill(filler)
        with pytest.raises(StorageFull):
            create_many_subjects(store)
        with pytest.raises(StorageFull):
            store.models.add(
                os.urandom(9000), subject="anna", layout="a", method="linear", parent=None, facts={}
            )
        assert store.takes.list() == [kept]
        assert len(store.takes.load(kept.id).time_s) == 300
        files = [path.name for path in (small_disk / "data" / "artifacts").iterdir()]
        assert files == [kept.artifact]
        filler.unlink()
        assert store.subjects.create("ben").name == "ben"
        store.takes.add(make_take(2), subject="anna", layout=LAYOUT.name, source="import")
        with store.database.read() as connection:
            assert connection.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"


def test_a_file_that_is_no_database_is_named(sqlite_settings):
    Store.open(sqlite_settings).close()
    file = sqlite_settings.data / "glovecal.sqlite3"
    for suffix in ("-wal", "-shm"):
        file.with_name(file.name + suffix).unlink(missing_ok=True)
    file.write_bytes(b"not a database, but a letter" * 100)
    with pytest.raises(StoreDamaged, match=r"glovecal\.sqlite3 is damaged .* restore a backup"):
        Store.open(sqlite_settings)


def test_an_io_error_on_a_full_disk_is_a_full_disk(small_disk):
    """SQLite says "disk I/O error" where its shared memory finds no room."""
    fill(small_disk / "filler")
    with pytest.raises(StorageFull, match="free some disk space"):
        Store.open(Settings(data=small_disk / "data", database=None, artifacts=None))
    for freed in range(4096, 60_000, 12_000):
        with (small_disk / "filler").open("r+b") as filler:
            filler.truncate(filler.seek(0, 2) - freed)
        try:
            Store.open(Settings(data=small_disk / "data", database=None, artifacts=None)).close()
        except StorageFull:
            continue


def test_declarations_that_were_changed_are_damage(sqlite_settings):
    """Flipped letters of CREATE TABLE: the schema as it was made, or StoreDamaged, whatever is asked for."""
    with Store.open(sqlite_settings) as store:
        store.subjects.create("anna")
    file = sqlite_settings.data / "glovecal.sqlite3"
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        made = [row[0] for row in connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL")]
    whole, sentences = file.read_bytes(), []
    with Store.open(sqlite_settings) as store:
        right = declared(store)
    for text in made:
        begin = whole.index(text.encode())
        for place in range(begin, begin + len(text.encode()), 97):
            for suffix in ("-wal", "-shm"):
                file.with_name(file.name + suffix).unlink(missing_ok=True)
            file.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
            try:
                with Store.open(sqlite_settings) as store:
                    store.subjects.create(f"s{place}")
                    store.jobs.create("train", {})
                    assert declared(store) == right, f"byte {place}"
            except StoreDamaged as error:
                sentences.append(str(error))
    assert len(sentences) > 20
    assert all("restore a backup" in sentence for sentence in sentences)


def declared(store: Store) -> list[tuple[str, str]]:
    with store.database.read() as connection:
        tables = ("subjects", "layouts", "gloves", "takes", "models", "jobs", "recordings")
        every = [connection.exec_driver_sql(f"PRAGMA table_info({table})").all() for table in tables]
    return [(row.name, row.type) for rows in every for row in rows]


def test_no_overwritten_bytes_make_another_model_active(sqlite_settings):
    """Every occurrence of the active model's id in the file is changed, one at a time."""
    with Store.open(sqlite_settings) as store:
        store.subjects.create("anna")
        model = store.models.add(
            b"m",
            subject="anna",
            layout="glove",
            method="linear",
            parent=None,
            facts={"held_out_rmse_deg": 2.5},
        )
        store.models.activate(model.id)
    file = sqlite_settings.data / "glovecal.sqlite3"
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    whole = file.read_bytes()
    targets = (model.id.encode(), b"2.5", b"anna", b"linear")
    places = [place for target in targets for place in _occurrences(whole, target)]
    assert len(places) >= 8
    for place in places:
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        try:
            with Store.open(sqlite_settings) as store:
                found = store.models.active("anna", "glove")
        except StoreError:
            continue
        assert found is None or found == model, f"byte {place} changed the answer"
    file.write_bytes(whole)
    with Store.open(sqlite_settings) as store:
        assert store.models.active("anna", "glove") == model


def _occurrences(content: bytes, wanted: bytes) -> list[int]:
    found, place = [], content.find(wanted)
    while place >= 0:
        found.append(place)
        place = content.find(wanted, place + 1)
    return found


def test_a_connection_that_outlives_the_store_is_closed_when_it_is_given_back(sqlite_store: Store) -> None:
    """A thread that was not waited for any longer may still have one."""
    with sqlite_store.database.read() as connection:
        used = connection.connection.dbapi_connection
        sqlite_store.close()
        assert used is not None
        used.cursor().execute("SELECT 1").close()
    with pytest.raises(sqlite3.ProgrammingError, match="closed"):
        used.cursor()
