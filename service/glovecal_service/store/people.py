"""People who prove who they are with a name and a password; of the password its hash alone is kept."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta

from sqlalchemy import select

from glovecal_client.site.roles import Role
from glovecal_service.store import tables
from glovecal_service.store.database import now
from glovecal_service.store.passwords import NOBODYS, check_password, is_password, password_hash
from glovecal_service.store.principals import Principal, Principals, principal_of, require_subjects
from glovecal_service.store.row_hash import sound_row


class People(Principals):
    noun = "person"
    own = tables.keys.c.password.is_not(None)

    def create(
        self, name: str, role: Role, subjects: Sequence[str] | None = None, *, password: str
    ) -> Principal:
        """Takes some 0.2 s of a processor, as every check of a password does. Raises BadInput, NotFound for a
        subject, and Conflict for a name that was ever used."""
        check_password(password, name)
        proof = {"password": password_hash(password), "password_changed_at": now()}
        return self._add(name, role, subjects, proof)

    def set_password(self, name: str, password: str) -> Principal:
        """Raises BadInput, NotFound."""
        check_password(password, name)
        hashed = password_hash(password)
        with self._database.write() as connection:
            before = self._present(connection, name)
            changed_at = _later(now(), before.password_changed_at)
            self._change(connection, name, {"password": hashed, "password_changed_at": changed_at})
            return self._present(connection, name)

    def change(self, name: str, role: Role, subjects: Sequence[str] | None) -> Principal:
        """What somebody may do. Raises BadInput, NotFound."""
        scope = self._checked(name, role, subjects)
        with self._database.write() as connection:
            self._present(connection, name)
            require_subjects(connection, scope["subjects"])
            self._change(connection, name, scope)
            return self._present(connection, name)

    def of(self, name: str, password: str) -> Principal | None:
        """Who it is; None where the password is wrong, or there is no such person (any more), which takes as
        long."""
        chosen = select(tables.keys).where(self.own, tables.keys.c.name == name)
        with self._database.read() as connection:
            row = connection.execute(chosen).one_or_none()
        values = None if row is None else sound_row(tables.keys, row)
        is_right = is_password(password, NOBODYS if values is None else values["password"])
        record = None if values is None else principal_of(values)
        return record if is_right and record is not None and record.is_valid else None


def _later(at: datetime, than: datetime | None) -> datetime:
    """A clock may be set back or stand still: a changed password still shows."""
    return at if than is None or at > than else than + timedelta(microseconds=1)
