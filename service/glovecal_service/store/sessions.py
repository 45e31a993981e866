"""Sessions of the studio: who logged in is known again by a token in the browser's cookie."""

from __future__ import annotations

import secrets
from datetime import timedelta

from sqlalchemy import delete, insert, select

from glovecal_service.store import tables
from glovecal_service.store.database import Database, now
from glovecal_service.store.keys import RANDOM_BYTES, secret_sha256
from glovecal_service.store.principals import Principal, principal_of
from glovecal_service.store.row_hash import sound_row

SESSION_HOURS = 12


class Sessions:
    def __init__(self, database: Database) -> None:
        self._database = database

    def begin(self, principal: Principal) -> str | None:
        """Its token; None if the principal was changed since it proved who it is. It ends after
        ``SESSION_HOURS``, and when the principal is changed or revoked."""
        token = secrets.token_urlsafe(RANDOM_BYTES)
        until = now() + timedelta(hours=SESSION_HOURS)
        chosen = select(tables.keys).where(tables.keys.c.name == principal.name).with_for_update()
        with self._database.write() as connection:
            row = connection.execute(chosen).one_or_none()
            if row is None or principal_of(sound_row(tables.keys, row)) != principal:
                return None
            connection.execute(delete(tables.sessions).where(tables.sessions.c.expires_at < now()))
            session = {"sha256": secret_sha256(token), "key": principal.name, "expires_at": until}
            connection.execute(insert(tables.sessions).values(**session))
        return token

    def of(self, token: str) -> Principal | None:
        """Whose it is; None once it has ended."""
        with self._database.read() as connection:
            chosen = select(tables.keys).where(
                tables.keys.c.name == tables.sessions.c.key,
                tables.sessions.c.sha256 == secret_sha256(token),
                tables.sessions.c.expires_at > now(),
            )
            row = connection.execute(chosen).one_or_none()
        record = None if row is None else principal_of(sound_row(tables.keys, row))
        return record if record is not None and record.is_valid else None

    def end(self, token: str) -> None:
        with self._database.write() as connection:
            ended = tables.sessions.c.sha256 == secret_sha256(token)
            connection.execute(delete(tables.sessions).where(ended))
