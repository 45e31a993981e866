"""The schema: built, compared, upgraded with a backup, refused when it is newer."""

import sqlite3
import threading
from contextlib import closing

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import text

from glovecal_service.settings import Settings
from glovecal_service.store import Store, migrate, schema
from glovecal_service.store.database import Database
from glovecal_service.store.migrate import UnknownSchema
from glovecal_service.store.tables import metadata

NEWEST = schema.newest_revision()
SECOND = """
import sqlalchemy as sa
from alembic import op

revision = "9999"
down_revision = "{newest}"


def upgrade() -> None:
    with op.batch_alter_table("subjects") as batch:
        batch.add_column(sa.Column("notes", sa.Text(), nullable=False, server_default="none"))
    op.execute("INSERT INTO revision (id, value) VALUES (2, 0)")
    {last}
"""


@pytest.fixture
def second_schema(tmp_path, monkeypatch):
    """Adds a later migration to the ones there are; called with its last line."""
    original = migrate._config

    def write(last: str) -> None:
        folder = tmp_path / "later"
        folder.mkdir(exist_ok=True)
        (folder / "9999_later.py").write_text(SECOND.format(last=last, newest=NEWEST))
        config = original(schema.migrations())
        own = f"{config.get_main_option('script_location')}/versions"
        config.set_main_option("version_locations", f"{own}:{folder}")
        monkeypatch.setattr(migrate, "_config", lambda scripts: config)
        monkeypatch.setattr(schema, "newest_revision", lambda: "9999")

    return write


def test_migrations_build_exactly_the_tables_of_the_code(store):
    with store.database.read() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_the_newest_revision_is_that_of_alembic():
    scripts = ScriptDirectory.from_config(migrate._config(schema.migrations()))
    assert schema.newest_revision() == scripts.get_current_head()


def test_opening_again_changes_nothing(store_settings):
    with Store.open(store_settings) as store:
        store.subjects.create("anna")
    with Store.open(store_settings) as store:
        assert [record.name for record in store.subjects.list()] == ["anna"]
    assert not list(store_settings.data.glob("*.before-*"))


def test_an_upgrade_keeps_the_rows_and_a_backup(store_settings, second_schema):
    with Store.open(store_settings) as store:
        store.subjects.create("anna")
    second_schema("pass")
    with Store.open(store_settings) as store, store.database.read() as connection:
        assert connection.execute(text("SELECT name, notes FROM subjects")).all() == [("anna", "none")]
    backups = list(store_settings.data.glob("*.before-9999"))
    assert len(backups) == (0 if store_settings.database else 1)
    for backup in backups:
        with closing(sqlite3.connect(backup)) as connection:
            assert connection.execute("SELECT name FROM subjects").fetchall() == [("anna",)]
            assert connection.execute("SELECT version_num FROM alembic_version").fetchall() == [(NEWEST,)]


def test_an_upgrade_that_fails_leaves_everything_as_it_was(store_settings, second_schema, monkeypatch):
    with Store.open(store_settings) as store:
        store.subjects.create("anna")
    second_schema('raise ArithmeticError("half-way")')
    with pytest.raises(ArithmeticError, match="half-way"):
        Store.open(store_settings)
    monkeypatch.undo()
    with Store.open(store_settings) as store, store.database.read() as connection:
        assert [record.name for record in store.subjects.list()] == ["anna"]
        context = MigrationContext.configure(connection)
        assert compare_metadata(context, metadata) == [], "no column and no temporary table is left"


def test_the_data_folder_may_have_any_name(sqlite_settings: Settings) -> None:
    folder = sqlite_settings.data / "what? #1 100%25 Geräte"
    with Store.open(sqlite_settings.model_copy(update={"data": folder})) as store:
        assert store.database.files[0] == folder / "glovecal.sqlite3"
    assert [file.name for file in sqlite_settings.data.iterdir()] == [folder.name]
    assert (folder / "glovecal.sqlite3").stat().st_size


def test_a_newer_schema_is_refused_with_a_sentence(store_settings):
    with Store.open(store_settings) as store, store.database.write() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(UnknownSchema, match="schema '9999', which this version of Glovecal does not know"):
        Store.open(store_settings)


def test_a_schema_of_before_the_first_release_is_refused_with_a_sentence(store_settings):
    with Store.open(store_settings) as store, store.database.write() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '0006'"))
    with pytest.raises(UnknownSchema, match="schema '0006', of a version before the first release"):
        Store.open(store_settings)


def test_several_processes_may_open_a_new_store_at_once(store_settings: Settings):
    failures = []

    def open_one() -> None:
        try:
            Store.open(store_settings).close()
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=open_one) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []


def test_sqlite_is_opened_the_safe_way(sqlite_store):
    wanted = {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1, "busy_timeout": 5000}
    with sqlite_store.database.read() as connection:
        found = {name: connection.exec_driver_sql(f"PRAGMA {name}").scalar() for name in wanted}
    assert found == wanted


def test_two_writers_wait_for_each_other(sqlite_settings):
    with Store.open(sqlite_settings) as store:
        other = Database(sqlite_settings.database_url)
        entered, created = threading.Event(), threading.Event()

        def create() -> None:
            entered.set()
            store.subjects.create("anna")
            created.set()

        with other.write() as connection:
            connection.execute(text("UPDATE revision SET value = value + 1"))
            thread = threading.Thread(target=create)
            thread.start()
            entered.wait()
            assert not created.wait(0.1)
        thread.join()
        assert created.is_set()
        other.close()
