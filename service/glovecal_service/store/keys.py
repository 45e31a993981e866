"""Keys with which programs and people prove who they are. Of a key its hash alone is kept."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import delete, insert, select
from sqlalchemy.exc import IntegrityError

from glovecal_client.site.roles import ROLES, Role
from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier, did_you_mean
from glovecal_service.store import tables
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.row_hash import add_row, change_rows, sound_row, sound_rows
from glovecal_service.store.subjects import require_subject

BEGINNING = "glk_"
"""Of every key: so that one that lies where it should not is recognised by scanners of secrets."""
RANDOM_BYTES = 32
SESSION_HOURS = 12


@dataclass(frozen=True)
class KeyRecord:
    name: str
    role: Role
    subjects: tuple[str, ...] | None
    """Whose takes and models it may see and change; None: everybody's."""
    created_at: datetime
    revoked_at: datetime | None

    @property
    def is_valid(self) -> bool:
        return self.revoked_at is None


class Keys:
    def __init__(self, database: Database) -> None:
        self._database = database

    def create(self, name: str, role: Role, subjects: Sequence[str] | None = None) -> tuple[KeyRecord, str]:
        """And the key itself, which nobody can be told again. Raises BadInput, NotFound for a subject, and
        Conflict for a name that was ever used."""
        check_identifier(name, "key")
        if role not in ROLES:
            raise BadInput(f"role of key {name!r} is {role!r}; {did_you_mean(role, ROLES)}")
        if subjects is not None and role == "admin":
            raise BadInput(f"key {name!r}: an admin is of all subjects; give another role, or no subjects")
        secret = BEGINNING + secrets.token_urlsafe(RANDOM_BYTES)
        record = KeyRecord(
            name, role, None if subjects is None else tuple(sorted(set(subjects))), now(), None
        )
        row = {
            "name": name, "sha256": _hash(secret), "role": role, "created_at": record.created_at,
            "subjects": None if record.subjects is None else list(record.subjects), "revoked_at": None,
        }  # fmt: skip
        try:
            with self._database.write() as connection:
                for subject in record.subjects or ():
                    require_subject(connection, subject)
                add_row(connection, tables.keys, row)
        except IntegrityError as error:
            raise Conflict(f"there was already a key {name!r}; names are not used again") from error
        return record, secret

    def list(self) -> list[KeyRecord]:
        """By name, those that were revoked among them."""
        statement = select(tables.keys).order_by(tables.keys.c.name)
        with self._database.read() as connection:
            return sound_rows(connection, tables.keys, statement, _record)

    def revoke(self, name: str) -> KeyRecord:
        """It opens nothing from the next request on. Raises NotFound."""
        with self._database.write() as connection:
            which = tables.keys.c.name == name
            row = connection.execute(select(tables.keys).where(which)).one_or_none()
            if row is None:
                every = connection.scalars(select(tables.keys.c.name).order_by(tables.keys.c.name))
                raise NotFound(f"there is no key {name!r}; {did_you_mean(name, every)}")
            record = _record(sound_row(tables.keys, row))
            if record.is_valid:
                change_rows(connection, tables.keys, which, {"revoked_at": now()})
                row = connection.execute(select(tables.keys).where(which)).one()
            return _record(sound_row(tables.keys, row))

    def of(self, secret: str) -> KeyRecord | None:
        """Whose key it is; None for one that never was or is revoked. Looked up by its hash: how long that
        takes tells nothing of the keys that there are."""
        if not secret.startswith(BEGINNING):
            return None
        with self._database.read() as connection:
            chosen = select(tables.keys).where(tables.keys.c.sha256 == _hash(secret))
            row = connection.execute(chosen).one_or_none()
        record = None if row is None else _record(sound_row(tables.keys, row))
        return record if record is not None and record.is_valid else None

    def begin_session(self, secret: str) -> str | None:
        """Its token, for a browser's cookie; None for what ``of`` does not know. It ends with the key, and
        after ``SESSION_HOURS``."""
        record = self.of(secret)
        if record is None:
            return None
        token = secrets.token_urlsafe(RANDOM_BYTES)
        until = now() + timedelta(hours=SESSION_HOURS)
        with self._database.write() as connection:
            connection.execute(delete(tables.sessions).where(tables.sessions.c.expires_at < now()))
            session = {"sha256": _hash(token), "key": record.name, "expires_at": until}
            connection.execute(insert(tables.sessions).values(**session))
        return token

    def of_session(self, token: str) -> KeyRecord | None:
        """As ``of``, of a token of ``begin_session``."""
        with self._database.read() as connection:
            chosen = select(tables.keys).where(
                tables.keys.c.name == tables.sessions.c.key,
                tables.sessions.c.sha256 == _hash(token),
                tables.sessions.c.expires_at > now(),
            )
            row = connection.execute(chosen).one_or_none()
        record = None if row is None else _record(sound_row(tables.keys, row))
        return record if record is not None and record.is_valid else None

    def end_session(self, token: str) -> None:
        with self._database.write() as connection:
            connection.execute(delete(tables.sessions).where(tables.sessions.c.sha256 == _hash(token)))

    @property
    def is_any(self) -> bool:
        """Whether somebody could prove to be an admin."""
        return any(record.is_valid and record.role == "admin" for record in self.list())


def _hash(secret: str) -> str:
    """A key has 256 random bits, so that guessing is hopeless however quick the hash is."""
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


def _record(values: Mapping[str, Any]) -> KeyRecord:
    subjects = values["subjects"]
    return KeyRecord(
        values["name"], values["role"], None if subjects is None else tuple(subjects), values["created_at"],
        values["revoked_at"],
    )  # fmt: skip
