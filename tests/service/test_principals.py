"""Keys and people in the store, on both databases: proofs, sessions, and keys of an older schema."""

from __future__ import annotations

import threading
import time

import pytest
from alembic import command
from sqlalchemy import insert, select

from glovecal_models.errors import BadInput
from glovecal_service.settings import Settings
from glovecal_service.store import Store, migrate, schema, tables
from glovecal_service.store.database import Database
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.list_part import ListPart
from glovecal_service.store.passwords import NOBODYS, is_password, password_hash

PASSWORD = "correct horse battery"


def test_a_person_is_known_by_the_password_alone(store: Store) -> None:
    store.subjects.create("ben")
    made = store.people.create("anna", "trainer", ["ben"], password=PASSWORD)
    assert (made.name, made.role, made.subjects, made.is_person) == ("anna", "trainer", ("ben",), True)
    assert store.people.of("anna", PASSWORD) == made
    for name, password in (("anna", PASSWORD + " "), ("anna", ""), ("ben", PASSWORD), ("", PASSWORD)):
        assert store.people.of(name, password) is None
    assert store.keys.of(PASSWORD) is None
    assert store.people.list() == [made]
    assert store.keys.list() == []
    store.people.revoke("anna")
    assert store.people.of("anna", PASSWORD) is None
    assert not store.people.has_admin


def test_one_name_is_one_key_or_person_for_ever(store: Store) -> None:
    store.keys.create("lena", "viewer")
    store.people.create("anna", "admin", password=PASSWORD)
    assert store.people.has_admin
    assert not store.keys.has_admin
    store.people.revoke("anna")
    for again in (
        lambda: store.people.create("lena", "viewer", password=PASSWORD),
        lambda: store.keys.create("anna", "viewer"),
    ):
        with pytest.raises(Conflict, match="names are not used again"):
            again()
    with pytest.raises(NotFound, match="no person 'lena'; there are anna"):
        store.people.revoke("lena")
    with pytest.raises(NotFound, match="no key 'anna'; there are lena"):
        store.keys.revoke("anna")


def test_what_may_not_be_a_password_is_refused_and_never_repeated(store: Store) -> None:
    for password in ("elevenchars", "x" * 201, "anna-maria-b"):
        with pytest.raises(BadInput) as refused:
            store.people.create("anna-maria-b", "viewer", password=password)
        assert password not in str(refused.value).replace("the name", "")
    with pytest.raises(BadInput, match="11 characters; give one of 12 to 200"):
        store.people.create("anna", "viewer", password="elevenchars")
    with pytest.raises(BadInput, match="is the name"):
        store.people.create("anna-maria-b", "viewer", password="ANNA-maria-b")
    with pytest.raises(BadInput, match="an admin is of all subjects"):
        store.people.create("anna", "admin", [], password=PASSWORD)
    assert store.people.list() == []


def test_what_is_changed_of_somebody_ends_their_sessions(store: Store) -> None:
    store.subjects.create("ben")
    anna = store.people.create("anna", "trainer", password=PASSWORD)
    other = store.sessions.begin(store.people.create("carla", "viewer", password=PASSWORD))
    changes = (
        lambda: store.people.change("anna", "viewer", None),
        lambda: store.people.change("anna", "viewer", ["ben"]),
        lambda: store.people.set_password("anna", PASSWORD + "!"),
        lambda: store.people.set_password("anna", PASSWORD + "!"),
        lambda: store.people.revoke("anna"),
    )
    for change in changes:
        token = store.sessions.begin(anna)
        assert token is not None
        assert store.sessions.of(token) == anna
        before, anna = anna, change()
        assert store.sessions.of(token) is None
        assert store.sessions.begin(before) is None, "proved who they are before the change"
    assert other is not None
    assert getattr(store.sessions.of(other), "name", None) == "carla"
    store.sessions.end(other)
    assert store.sessions.of(other) is None


def test_the_log_of_changes_says_that_a_password_changed_and_holds_none(store: Store) -> None:
    store.people.create("anna", "viewer", password=PASSWORD)
    store.people.set_password("anna", PASSWORD + "!")
    newest = store.audit.page(ListPart(limit=1)).records[0]
    assert newest.changes[0]["key"] == "anna"
    assert list(newest.changes[0]["after"]) == ["password_changed_at"]
    assert "argon2" not in str([entry.changes for entry in store.audit.page(ListPart(limit=10)).records])
    assert store.audit.problems() == []


def test_a_name_that_is_not_there_costs_as_much_as_a_wrong_password(
    sqlite_store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Time itself is not held: other programs run beside this test. What takes the time is: one hash each."""
    checked = []

    def counted(password: str, hashed: str) -> bool:
        checked.append(hashed.rpartition("$")[0].rpartition("$")[0])
        return is_password(password, hashed)

    monkeypatch.setattr("glovecal_service.store.people.is_password", counted)
    sqlite_store.people.create("anna", "viewer", password=PASSWORD)
    sqlite_store.people.create("gone", "viewer", password=PASSWORD)
    sqlite_store.people.revoke("gone")
    for name in ("anna", "gone", "nobody"):
        assert sqlite_store.people.of(name, "wrong wrong wrong") is None
    assert sqlite_store.people.of("gone", PASSWORD) is None
    assert checked == ["$argon2id$v=19$m=65536,t=3,p=1"] * 4


def test_passwords_are_hashed_slowly_with_salt_and_read_as_any_keyboard_writes_them() -> None:
    one, other = password_hash("pässword-long"), password_hash("pässword-long")
    assert one != other
    assert one.startswith("$argon2id$v=19$m=65536,t=3,p=1$")
    assert is_password("pässword-long", one), "decomposed"
    assert not is_password("passw\u006frd-long", one)
    began = time.process_time()
    assert not is_password("any", NOBODYS)
    assert time.process_time() - began > 0.02, "of the processor, in seconds: guessing is dear"


def test_several_passwords_are_checked_at_once() -> None:
    """With more than one lane, OpenSSL's threads wait for each other for ever."""
    hashed, answers = password_hash(PASSWORD), []
    checks = [
        threading.Thread(target=lambda: answers.append(is_password(PASSWORD, hashed)), daemon=True)
        for _ in range(4)
    ]
    for check in checks:
        check.start()
    for check in checks:
        check.join(timeout=60.0)
    assert answers == [True] * 4


def test_keys_of_the_schema_before_people_still_open(store_settings: Settings) -> None:
    database = Database(store_settings.database_url)
    store_settings.data.mkdir(parents=True, exist_ok=True)
    config = migrate._config(schema.migrations())
    with database.write() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0009")
    elsewhere = store_settings.model_copy(update={"data": store_settings.data / "new", "database": None})
    with Store.open(elsewhere) as new:
        record, secret = new.keys.create("lena", "trainer")
        token = new.sessions.begin(record)
        with new.database.read() as connection:
            key = connection.execute(select(tables.keys)).one()._mapping
            session = connection.execute(select(tables.sessions)).one()._mapping
    with database.write() as connection:
        there = {name: key[name] for name in ("name", "sha256", "role", "created_at", "row_sha256")}
        connection.execute(insert(tables.keys).values(**there))
        connection.execute(insert(tables.sessions).values(**session))
    database.close()
    with Store.open(store_settings) as store:
        assert store.keys.of(secret) == record
        assert token is not None
        assert store.sessions.of(token) is None, "people log in again after this upgrade"
        assert store.sessions.begin(record) is not None
        store.people.create("anna", "viewer", password=PASSWORD)
        with pytest.raises(Conflict):
            store.keys.create("lena", "viewer")


def test_people_with_passwords_of_the_schema_before_providers_still_log_in(store_settings: Settings) -> None:
    database = Database(store_settings.database_url)
    store_settings.data.mkdir(parents=True, exist_ok=True)
    config = migrate._config(schema.migrations())
    with database.write() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0010")
    elsewhere = store_settings.model_copy(update={"data": store_settings.data / "new", "database": None})
    with Store.open(elsewhere) as new:
        anna = new.people.create("anna", "trainer", password=PASSWORD)
        with new.database.read() as connection:
            row = dict(connection.execute(select(tables.keys)).one()._mapping)
    with database.write() as connection:
        there = {name: value for name, value in row.items() if value is not None}
        connection.execute(insert(tables.keys).values(**there))
    database.close()
    with Store.open(store_settings) as store:
        assert store.people.of("anna", PASSWORD) == anna
        assert store.people.let_in("ben", "viewer", issuer="https://a", sub="1").name == "ben"


def test_a_person_of_a_provider_is_who_it_says_and_stays_so(store: Store) -> None:
    store.keys.create("anna", "viewer")
    name = store.people.name_of("https://a", "1", "Anna@studio.example")
    assert name == "anna-2", "one name is one key or person"
    anna = store.people.let_in(name, "operator", issuer="https://a", sub="1")
    assert (anna.is_person, anna.password_changed_at, anna.issuer) == (True, None, "https://a")
    assert store.people.name_of("https://a", "1", "Somebody else") == name
    assert store.people.name_of("https://b", "1", "anna") == "anna-3", "another provider's is another person"
    assert store.people.of(name, "") is None
    token = store.sessions.begin(anna)
    assert token is not None
    assert store.people.let_in(name, "operator", issuer="https://a", sub="1") == anna
    assert store.sessions.of(token) == anna
    assert store.people.let_in(name, "admin", issuer="https://a", sub="1").role == "admin"
    assert store.sessions.of(token) is None
    assert not store.people.has_admin
    with pytest.raises(Conflict):
        store.people.let_in(name, "viewer", issuer="https://b", sub="1")
    store.people.revoke(name)
    with pytest.raises(BadInput, match="was removed by an admin"):
        store.people.let_in(name, "viewer", issuer="https://a", sub="1")
