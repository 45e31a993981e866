"""A backup holds what was acknowledged before it began, and is found out where it is not what was written."""

from __future__ import annotations

import io
import tarfile
import threading
from pathlib import Path

import numpy as np
import pytest
from filled_store import fill
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from postgres_server import PostgresServer
from realtime_support import store_model
from sqlalchemy import select, text

from glovecal_models.calibration.artifact import load
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.errors import BadInput
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.backup import check_backup, make_backup, restore_backup
from glovecal_service.store.tables import JsonText, metadata


def everything(store: Store) -> dict[str, list[tuple]]:
    """All rows of all tables."""
    rows = {}
    for table in metadata.sorted_tables:
        with store.database.read() as connection:
            found = connection.execute(select(table).order_by(*table.primary_key.columns)).all()
        rows[table.name] = [
            tuple(value.document if isinstance(value, JsonText) else value for value in row) for row in found
        ]
    return rows


def elsewhere(tmp_path: Path, name: str = "restored", **changes: object) -> Settings:
    return Settings.model_validate({"data": tmp_path / name, "database": None, "artifacts": None, **changes})


def predicted(store: Store, id: str) -> bytes:
    readings = np.random.default_rng(0).uniform(20.0, 230.0, (50, 3))
    angles = GlovePredictor(load(store.models.load_bytes(id))).predict(readings)
    return angles.mean.tobytes() + angles.sd.tobytes()


def test_a_backup_under_load_has_all_that_was_acknowledged_and_predicts_the_same(
    store_settings: Settings, tmp_path: Path
) -> None:
    with Store.open(store_settings) as store:
        fill(store)
        model = store_model(store, "clara", degrees_per_count=0.5)
        (store_settings.uploads_folder / "first.csv").write_bytes(b"time_s,take\n")
        acknowledged: list[str] = []
        stop = threading.Event()

        def write() -> None:
            number = 0
            while not stop.is_set():
                number += 1
                acknowledged.append(store.subjects.create(f"s{number}").name)
                store.jobs.create("train", {"takes": [], "number": number}, subject="clara")

        writer = threading.Thread(target=write)
        writer.start()
        try:
            while len(acknowledged) < 20:
                stop.wait(0.01)
            before = list(acknowledged)
            made = make_backup(store, store_settings, tmp_path / "all.backup")
            assert len(acknowledged) > len(before), "nobody waited for it"
        finally:
            stop.set()
            writer.join()
        assert made.problems == ()
        place = elsewhere(tmp_path)
        assert restore_backup(tmp_path / "all.backup", place).rows == made.rows
        with Store.open(place) as restored:
            assert set(before) <= {each.name for each in restored.subjects.list()}
            assert predicted(restored, model) == predicted(store, model)
            active = restored.models.active("clara", "three-bends")
            assert active is not None
            assert active.id == model
            assert (place.uploads_folder / "first.csv").read_bytes() == b"time_s,take\n"
            restored.subjects.create("zoe")
            assert restored.audit.problems() == []
    assert not [each for each in tmp_path.iterdir() if each.name.startswith(".")], "nothing is left beside"


@pytest.mark.needs_postgres
def test_from_one_database_to_the_other_and_back_nothing_changes(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    home = elsewhere(tmp_path, "home")
    with Store.open(home) as store:
        fill(store)
        first = everything(store)
        make_backup(store, home, tmp_path / "one.backup")
    server = elsewhere(tmp_path, "server", database=postgres.new_database())
    restore_backup(tmp_path / "one.backup", server)
    with Store.open(server) as store:
        assert everything(store) == first
        make_backup(store, server, tmp_path / "two.backup")
        job = store.jobs.create("train", {"takes": []}, subject="anna")
        assert store.jobs.get(job.id).state == "queued"
        assert store.audit.problems() == []
        with pytest.raises(BadInput, match="is not empty"):
            restore_backup(tmp_path / "one.backup", elsewhere(tmp_path, "third", database=server.database))
    back = elsewhere(tmp_path, "back")
    restore_backup(tmp_path / "two.backup", back)
    with Store.open(back) as store:
        assert everything(store) == first


def test_artifacts_go_into_the_object_store_that_is_named(tmp_path: Path) -> None:
    home, objects = elsewhere(tmp_path, "home"), tmp_path / "objects"
    objects.mkdir()
    with Store.open(home) as store:
        model = store_model(store, "anna", degrees_per_count=0.5)
        first = predicted(store, model)
        make_backup(store, home, tmp_path / "a.backup")
    place = elsewhere(tmp_path, artifacts=objects.as_uri())
    assert restore_backup(tmp_path / "a.backup", place).problems == ()
    assert not place.artifacts_folder.exists()
    with Store.open(place) as store:
        assert predicted(store, model) == first
        make_backup(store, place, tmp_path / "b.backup")
    restore_backup(tmp_path / "b.backup", elsewhere(tmp_path, "again"))
    with Store.open(elsewhere(tmp_path, "again")) as store:
        assert predicted(store, model) == first


@pytest.fixture(scope="module")
def backup(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    place = tmp_path_factory.mktemp("made")
    home = elsewhere(place, "home")
    with Store.open(home) as store:
        store_model(store, "anna", degrees_per_count=0.5)
        make_backup(store, home, place / "a.backup")
    return (place / "a.backup").read_bytes()


@given(data=st.data())
@hypothesis_settings(max_examples=40)
def test_a_changed_byte_or_a_cut_is_found_or_changes_nothing_that_is_restored(
    backup: bytes, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    place = tmp_path_factory.mktemp("changed")
    at = data.draw(st.integers(0, len(backup) - 1))
    if data.draw(st.booleans(), "cut"):
        content = backup[:at]
    else:
        content = backup[:at] + bytes([backup[at] ^ (1 << data.draw(st.integers(0, 7)))]) + backup[at + 1 :]
    (place / "a.backup").write_bytes(content)
    (place / "sound.backup").write_bytes(backup)
    try:
        found = check_backup(place / "a.backup")
    except BadInput:
        return
    sound = check_backup(place / "sound.backup")
    assert (found.rows, found.artifacts, found.files, found.problems) == (
        sound.rows, sound.artifacts, sound.files, sound.problems,
    )  # fmt: skip


def test_what_is_damaged_before_is_told_by_name(tmp_path: Path) -> None:
    home = elsewhere(tmp_path, "home")
    with Store.open(home) as store:
        fill(store)
        model = store_model(store, "clara", degrees_per_count=0.5)
        with store.database.write() as connection:
            connection.execute(text("UPDATE takes SET name = 'other' WHERE name = 't0'"))
        artifact = home.artifacts_folder / model
        artifact.write_bytes(artifact.read_bytes()[:-1] + b"x")
        made = make_backup(store, home, tmp_path / "a.backup")
    assert len(made.problems) == 2
    assert any(model in problem for problem in made.problems)
    assert any("take" in problem for problem in made.problems)


def test_nothing_is_overwritten_and_nothing_leaves_its_folder(tmp_path: Path, backup: bytes) -> None:
    home, file = elsewhere(tmp_path, "home"), tmp_path / "a.backup"
    file.write_bytes(backup)
    with Store.open(home) as store:
        with pytest.raises(BadInput, match="exists already"):
            make_backup(store, home, file)
        with pytest.raises(BadInput, match="lies in the data folder"):
            make_backup(store, home, home.data / "b.backup")
    with pytest.raises(BadInput, match="is not empty"):
        restore_backup(file, home)
    (tmp_path / "other.backup").write_bytes(b"no tar file")
    with pytest.raises(BadInput, match=r"other\.backup is damaged or no backup"):
        restore_backup(tmp_path / "other.backup", elsewhere(tmp_path))
    evil = tmp_path / "evil.backup"
    with tarfile.open(file) as sound, tarfile.open(evil, "w") as archive:
        for entry in sound:
            content = sound.extractfile(entry)
            assert content is not None
            read = content.read().replace(b'"database.sqlite3"', b'"files/../../x.sqlite3"')
            entry.name = entry.name.replace("database.sqlite3", "files/../../x.sqlite3")
            entry.size = len(read)
            archive.addfile(entry, io.BytesIO(read))
    with pytest.raises(BadInput, match="does not belong there"):
        restore_backup(evil, elsewhere(tmp_path))
    assert not (tmp_path / "restored").exists()
    assert not (tmp_path / "x.sqlite3").exists()
