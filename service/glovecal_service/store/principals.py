"""Who may ask: a program or a person by a key, a person by a password or by a provider's word; each has one
name, role and scope.

Names are never used again, so that the log of changes means one of them. Whatever changes of somebody ends
their sessions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, ClassVar

from sqlalchemy import ColumnElement, Connection, delete, select
from sqlalchemy.exc import IntegrityError

from glovecal_client.site.roles import ROLES, Role
from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier, did_you_mean
from glovecal_service.store import tables
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.list_part import Listing, ListPart, Page
from glovecal_service.store.row_hash import add_row, change_rows, sound_row, sound_rows
from glovecal_service.store.subjects import require_subject


@dataclass(frozen=True)
class Principal:
    name: str
    role: Role
    subjects: tuple[str, ...] | None
    """Whose takes and models it may see and change; None: everybody's."""
    created_at: datetime
    revoked_at: datetime | None
    password_changed_at: datetime | None
    """None: it has none."""
    issuer: str | None
    """The provider of OpenID Connect that says who it is, and gives its role; None: it proves that here."""

    @property
    def is_valid(self) -> bool:
        return self.revoked_at is None

    @property
    def is_person(self) -> bool:
        return self.password_changed_at is not None or self.issuer is not None


_LISTING = Listing(tables.keys, ("name",), searched=("name", "role"))


class Principals:
    """Those of one kind."""

    noun: ClassVar[str]
    own: ClassVar[ColumnElement[bool]]
    """Chooses the rows of this kind."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def list(self) -> list[Principal]:
        """By name, those that were revoked among them."""
        with self._database.read() as connection:
            return sound_rows(connection, tables.keys, _LISTING.every(self.own), principal_of)

    def page(self, part: ListPart) -> Page[Principal]:
        """A part of them."""
        with self._database.read() as connection:
            return _LISTING.page(connection, principal_of, part, self.own)

    def revoke(self, name: str) -> Principal:
        """Opens nothing from the next request on. Raises NotFound."""
        with self._database.write() as connection:
            if self._present(connection, name).is_valid:
                self._change(connection, name, {"revoked_at": now()})
            return self._present(connection, name)

    @property
    def has_admin(self) -> bool:
        """Whether somebody could prove to be an admin, also while a provider is away."""
        return any(each.is_valid and each.role == "admin" and each.issuer is None for each in self.list())

    def _add(
        self, name: str, role: Role, subjects: Sequence[str] | None, proof: Mapping[str, Any]
    ) -> Principal:
        """``proof``: the columns by which it is known again. Raises BadInput, NotFound for a subject, and
        Conflict for a name that was ever used."""
        check_identifier(name, self.noun)
        scope = self._checked(name, role, subjects)
        row = {"name": name, "created_at": now(), "revoked_at": None, **scope, **proof}
        try:
            with self._database.write() as connection:
                require_subjects(connection, scope["subjects"])
                add_row(connection, tables.keys, row)
                return self._present(connection, name)
        except IntegrityError as error:
            raise Conflict(
                f"there was already a key or a person {name!r}; names are not used again: give another"
            ) from error

    def _checked(self, name: str, role: Role, subjects: Sequence[str] | None) -> dict[str, Any]:
        if role not in ROLES:
            raise BadInput(f"role of {self.noun} {name!r} is {role!r}; {did_you_mean(role, ROLES)}")
        if subjects is not None and role == "admin":
            raise BadInput(
                f"{self.noun} {name!r}: an admin is of all subjects; give another role, or no subjects"
            )
        return {"role": role, "subjects": None if subjects is None else sorted(set(subjects))}

    def _present(self, connection: Connection, name: str) -> Principal:
        row = connection.execute(select(tables.keys).where(self.own, tables.keys.c.name == name))
        if (there := row.one_or_none()) is None:
            names = select(tables.keys.c.name).where(self.own).order_by(tables.keys.c.name)
            every = connection.scalars(names)
            raise NotFound(f"there is no {self.noun} {name!r}; {did_you_mean(name, every)}")
        return principal_of(sound_row(tables.keys, there))

    def _change(self, connection: Connection, name: str, values: Mapping[str, Any]) -> None:
        change_rows(connection, tables.keys, tables.keys.c.name == name, values)
        connection.execute(delete(tables.sessions).where(tables.sessions.c.key == name))


def require_subjects(connection: Connection, subjects: Sequence[str] | None) -> None:
    """Raises NotFound for one that there is not."""
    for subject in subjects or ():
        require_subject(connection, subject)


def principal_of(values: Mapping[str, Any]) -> Principal:
    """From the values of a sound row."""
    subjects = values["subjects"]
    return Principal(
        values["name"], values["role"], None if subjects is None else tuple(subjects), values["created_at"],
        values["revoked_at"], values["password_changed_at"], values["issuer"],
    )  # fmt: skip
