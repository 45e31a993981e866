"""The search for damage: what it finds is remembered until it is sound again or gone, and nothing else is."""

from __future__ import annotations

from pathlib import Path

import pytest
from filled_store import PROTECTED, fill
from sqlalchemy import text

from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.damages import Damage
from glovecal_service.store.tables import metadata


def searched(store: Store) -> list[Damage]:
    return [damage for found in store.damages.search() for damage in found]


def known(store: Store) -> list[tuple[str, str]]:
    return [(damage.table, damage.id) for damage in store.damages.list(limit=100)[0]]


def change(store: Store, statement: str, **values: object) -> None:
    with store.database.engine.begin() as connection:
        assert connection.execute(text(statement), values).rowcount == 1


@pytest.mark.parametrize("table", PROTECTED)
def test_a_changed_row_of_any_table_is_found_once_and_forgotten_when_it_is_as_before(
    store: Store, table: str
) -> None:
    fill(store)
    assert searched(store) == []
    keys = [column.name for column in metadata.tables[table].primary_key.columns]
    with store.database.read() as connection:
        row = connection.execute(text(f"SELECT * FROM {table} LIMIT 1")).one()._mapping
    same = " AND ".join(f"{key} = :{key}" for key in keys)
    own = {key: row[key] for key in keys}
    change(store, f"UPDATE {table} SET row_sha256 = 'x' WHERE {same}", **own)
    (found,) = searched(store)
    assert (found.table, found.id) == (table, "/".join(str(row[key]) for key in keys))
    assert f"of table {table} was changed after it was written; restore a backup" in found.sentence
    assert searched(store) == [], "it is known"
    store.damages.look_again()
    assert known(store) == [(found.table, found.id)]
    change(store, f"UPDATE {table} SET row_sha256 = :right WHERE {same}", right=row["row_sha256"], **own)
    store.damages.look_again()
    assert known(store) == []


def test_damaged_artifacts_of_takes_and_models_are_found(sqlite_settings: Settings) -> None:
    with Store.open(sqlite_settings) as store:
        fill(store)
        folder, take, (old, active) = (
            sqlite_settings.artifacts_folder,
            store.takes.list()[0],
            store.models.list(),
        )
        kept = {id: Path(folder, id).read_bytes() for id in (take.artifact, old.id, active.id)}
        for id in kept:
            Path(folder, id).write_bytes(b"other")
        sentences = {damage.id: damage.sentence for damage in searched(store)}
        assert set(sentences) == {take.id, old.id, active.id}
        assert sentences[take.id].startswith(f"take {take.name} ({take.id}) cannot be loaded: artifact ")
        assert sentences[active.id].endswith(", or train again: glovecal train --subject anna")
        assert sentences[old.id].endswith(f", or remove it: glovecal model remove {old.id[:12]}")
        assert store.damages.of_models([old.id, "0" * 64]) == {old.id: sentences[old.id]}
        store.models.remove(old.id)
        Path(folder, take.artifact).write_bytes(kept[take.artifact])
        store.damages.look_again()
        assert known(store) == [("models", active.id)]


def test_a_row_whose_key_was_overwritten_stays_known_until_the_next_search(sqlite_settings: Settings) -> None:
    with Store.open(sqlite_settings) as store:
        fill(store)
        take = store.takes.list()[0]
        change(store, "UPDATE takes SET id = :bytes WHERE id = :id", bytes=b"\xff\x00", id=take.id)
        (found,) = searched(store)
        store.damages.look_again()
        assert known(store) == [("takes", found.id)]
        change(store, "UPDATE takes SET id = :id WHERE id = :bytes", bytes=b"\xff\x00", id=take.id)
        assert searched(store) == []
        assert known(store) == []


def test_every_one_of_many_damaged_rows_is_found(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("glovecal_service.store.damages.AT_ONCE", 3)
    for _ in range(10):
        store.jobs.create("train", {})
    with store.database.engine.begin() as connection:
        connection.execute(text("UPDATE jobs SET kind = 'improve'"))
    assert len(searched(store)) == 10
    found, total = store.damages.list(limit=4)
    assert (len(found), total) == (4, 10)
    with store.database.engine.begin() as connection:
        connection.execute(text("DELETE FROM job_events"))
        connection.execute(text("DELETE FROM jobs"))
    store.damages.look_again()
    assert known(store) == []


def test_what_is_known_of_a_person_goes_with_the_person(store: Store, store_settings: Settings) -> None:
    from glovecal_service.store.erasure import erase

    store.subjects.create("anna")
    store.damages.note("models", "abc", "model abc of anna is damaged", "anna")
    store.damages.note("models", "abd", "model abd of ben is damaged", "ben")
    erase(store, store_settings, "anna")
    assert known(store) == [("models", "abd")]


def test_a_row_that_an_index_does_not_find_is_told(sqlite_settings: Settings) -> None:
    """A list would leave it out without a word."""
    with Store.open(sqlite_settings) as store:
        fill(store)
        with store.database.engine.begin() as connection:
            connection.exec_driver_sql("PRAGMA writable_schema = ON")
            connection.exec_driver_sql(
                "UPDATE sqlite_master SET sql = sql || ' WHERE subject <> ''anna''' "
                "WHERE name = 'ix_takes_subject_created_at_id'"
            )
    with Store.open(sqlite_settings) as store, store.database.engine.begin() as connection:
        connection.exec_driver_sql("REINDEX ix_takes_subject_created_at_id")
        connection.exec_driver_sql("PRAGMA writable_schema = ON")
        connection.exec_driver_sql(
            "UPDATE sqlite_master SET sql = substr(sql, 1, instr(sql, ' WHERE') - 1) "
            "WHERE name = 'ix_takes_subject_created_at_id'"
        )
    with Store.open(sqlite_settings) as store:
        assert searched(store)[0].sentence.startswith(
            "table takes or an index of it is damaged (row 1 missing from index "
        )
