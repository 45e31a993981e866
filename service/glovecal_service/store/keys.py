"""Keys with which programs and people prove who they are. Of a key its hash alone is kept."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Sequence

from sqlalchemy import select

from glovecal_client.site.roles import Role
from glovecal_service.store import tables
from glovecal_service.store.principals import Principal, Principals, principal_of
from glovecal_service.store.row_hash import sound_row

BEGINNING = "glk_"
"""Of every key: so that one that lies where it should not is recognised by scanners of secrets."""
RANDOM_BYTES = 32


class Keys(Principals):
    noun = "key"
    own = tables.keys.c.sha256.is_not(None)

    def create(self, name: str, role: Role, subjects: Sequence[str] | None = None) -> tuple[Principal, str]:
        """And the key itself, which nobody can be told again. Raises BadInput, NotFound for a subject, and
        Conflict for a name that was ever used."""
        secret = BEGINNING + secrets.token_urlsafe(RANDOM_BYTES)
        return self._add(name, role, subjects, {"sha256": secret_sha256(secret)}), secret

    def of(self, secret: str) -> Principal | None:
        """Whose key it is; None for one that never was or is revoked. Looked up by its hash: how long that
        takes tells nothing of the keys that there are."""
        if not secret.startswith(BEGINNING):
            return None
        with self._database.read() as connection:
            chosen = select(tables.keys).where(tables.keys.c.sha256 == secret_sha256(secret))
            row = connection.execute(chosen).one_or_none()
        record = None if row is None else principal_of(sound_row(tables.keys, row))
        return record if record is not None and record.is_valid else None


def secret_sha256(secret: str) -> str:
    """What is kept of a key or a session: 256 random bits cannot be guessed, however quick the hash is."""
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()
