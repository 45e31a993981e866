"""People who prove who they are with a name and a password, of which the hash alone is kept, or whom a
provider of OpenID Connect knows: of them it gives the role at each login."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Sequence
from datetime import datetime, timedelta

from sqlalchemy import ColumnElement, and_, or_, select

from glovecal_client.site.roles import Role
from glovecal_models.errors import BadInput
from glovecal_models.names import DEVICES
from glovecal_service.store import tables
from glovecal_service.store.database import now
from glovecal_service.store.passwords import NOBODYS, check_password, is_password, password_hash
from glovecal_service.store.principals import Principal, Principals, principal_of, require_subjects
from glovecal_service.store.row_hash import sound_row

LONGEST_PREFERRED_NAME = 48
"""Characters of it that become a name here; a number may follow."""


class People(Principals):
    noun = "person"
    own = or_(tables.keys.c.password.is_not(None), tables.keys.c.issuer.is_not(None))

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
            if before.issuer is not None:
                raise BadInput(f"{name} has no password here: it is kept, and changed, at {before.issuer}")
            changed_at = _later(now(), before.password_changed_at)
            self._change(connection, name, {"password": hashed, "password_changed_at": changed_at})
            return self._present(connection, name)

    def change(self, name: str, role: Role, subjects: Sequence[str] | None) -> Principal:
        """What somebody may do. Raises BadInput, NotFound."""
        scope = self._checked(name, role, subjects)
        with self._database.write() as connection:
            before = self._present(connection, name)
            if before.issuer is not None and role != before.role:
                raise BadInput(
                    f"the role of {name} comes from {before.issuer} at each login: change it there, or in "
                    f"GLOVECAL_OIDC_ROLES; other subjects can be given here, with the role {before.role}"
                )
            require_subjects(connection, scope["subjects"])
            self._change(connection, name, scope)
            return self._present(connection, name)

    def of(self, name: str, password: str) -> Principal | None:
        """Who it is; None where the password is wrong, or there is no such person (any more), which takes as
        long."""
        chosen = select(tables.keys).where(tables.keys.c.password.is_not(None), tables.keys.c.name == name)
        with self._database.read() as connection:
            row = connection.execute(chosen).one_or_none()
        values = None if row is None else sound_row(tables.keys, row)
        is_right = is_password(password, NOBODYS if values is None else values["password"])
        record = None if values is None else principal_of(values)
        return record if is_right and record is not None and record.is_valid else None

    def name_of(self, issuer: str, sub: str, preferred: str) -> str:
        """The name here of whom ``issuer`` calls ``sub``: that of their first login; before it one that is
        free, like ``preferred``."""
        with self._database.read() as connection:
            known = connection.scalar(select(tables.keys.c.name).where(_known_as(issuer, sub)))
            if known is not None:
                return known
            taken = {*connection.scalars(select(tables.keys.c.name)), *DEVICES}
        letters = (
            unicodedata.normalize("NFKD", preferred.partition("@")[0]).encode("ascii", "ignore").decode()
        )
        plain = re.sub(r"[^a-z0-9_-]+", "-", letters.lower())[:LONGEST_PREFERRED_NAME].strip("-_") or "person"
        names = itertools.chain([plain], (f"{plain}-{number}" for number in itertools.count(2)))
        return next(name for name in names if name not in taken)

    def let_in(self, name: str, role: Role, *, issuer: str, sub: str) -> Principal:
        """Whom ``issuer`` knows as ``sub``, with the role of this login; ``name`` from ``name_of``. Sessions
        with another role end. Raises BadInput for whom an admin shut out or limited, Conflict where the name
        was given to somebody else meanwhile."""
        with self._database.read() as connection:
            row = connection.execute(select(tables.keys).where(_known_as(issuer, sub))).one_or_none()
        if row is None:
            return self._add(name, role, None, {"issuer": issuer, "issuer_sub": sub})
        before = principal_of(sound_row(tables.keys, row))
        if not before.is_valid:
            raise BadInput(
                f"{name} was removed by an admin of this service, who can let you in under another name: "
                "glovecal person add NAME"
            )
        if before.role == role:
            return before
        if before.subjects is not None and role == "admin":
            raise BadInput(
                f"{name} is an admin by this login, and limited to some subjects here; an admin ends that: "
                f"glovecal person change {name} --everybody"
            )
        with self._database.write() as connection:
            self._change(connection, name, {"role": role})
            return self._present(connection, name)


def _known_as(issuer: str, sub: str) -> ColumnElement[bool]:
    return and_(tables.keys.c.issuer == issuer, tables.keys.c.issuer_sub == sub)


def _later(at: datetime, than: datetime | None) -> datetime:
    """A clock may be set back or stand still: a changed password still shows."""
    return at if than is None or at > than else than + timedelta(microseconds=1)
