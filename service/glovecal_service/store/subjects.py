"""Subjects: the people whose hands are calibrated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, get_args

from sqlalchemy import ColumnElement, Connection, Table, delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import Handedness
from glovecal_models.names import check_identifier, did_you_mean
from glovecal_service.store import tables
from glovecal_service.store.changes import tell_change, tell_forgotten_subject
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.list_part import Listing, ListPart, Page
from glovecal_service.store.records import SubjectRecord
from glovecal_service.store.row_hash import sound_row, sound_rows
from glovecal_service.store.texts import check_text

_LISTING = Listing(tables.subjects, ("name",), searched=("name", "title"))


class Subjects:
    def __init__(self, database: Database) -> None:
        self._database = database

    def create(
        self,
        name: str,
        *,
        title: str = "",
        dimensions: Mapping[str, float] | None = None,
        hand: Handedness | None = None,
    ) -> SubjectRecord:
        """Add a person. Raises BadInput for a bad name or dimension, Conflict if the name is taken."""
        record = SubjectRecord(
            check_identifier(name, "subject"),
            check_text(title, f"title of subject {name!r}", empty=True),
            _dimensions(name, dimensions or {}),
            now(),
            "unknown" if hand is None else _hand(name, hand),
        )
        try:
            with self._database.write() as connection:
                connection.execute(insert(tables.subjects).values(**record.__dict__))
        except IntegrityError as error:
            raise Conflict(f"there is already a subject {name!r}") from error
        return record

    def get(self, name: str) -> SubjectRecord:
        """Raises NotFound."""
        with self._database.read() as connection:
            return require_subject(connection, name)

    def list(self) -> list[SubjectRecord]:
        """All subjects by name."""
        with self._database.read() as connection:
            return sound_rows(connection, tables.subjects, _LISTING.every(), _record)

    def page(self, part: ListPart) -> Page[SubjectRecord]:
        """A part of them, by name."""
        with self._database.read() as connection:
            return _LISTING.page(connection, _record, part)

    def names(self) -> set[str]:
        """Of all."""
        with self._database.read() as connection:
            return set(connection.scalars(select(tables.subjects.c.name)))

    def count(self) -> int:
        """How many there are."""
        with self._database.read() as connection:
            return connection.scalar(select(func.count()).select_from(tables.subjects)) or 0

    def measure(
        self, name: str, dimensions: Mapping[str, float], hand: Handedness | None = None
    ) -> SubjectRecord:
        """Replace what was measured of a person's hand, and say which one it is; None leaves that as it is.

        Raises NotFound, BadInput.
        """
        values: dict[str, Any] = {"dimensions": _dimensions(name, dimensions)}
        if hand is not None:
            values["hand"] = _hand(name, hand)
        with self._database.write() as connection:
            require_subject(connection, name)
            changed = update(tables.subjects).where(tables.subjects.c.name == name)
            connection.execute(changed.values(**values))
            tell_change(connection, "subject", name)  # poses go with the hand that draws them
            return require_subject(connection, name)

    def remove(self, name: str) -> None:
        """Forget a person. Raises NotFound, or Conflict while takes or models of theirs exist."""
        with self._database.write() as connection:
            require_subject(connection, name)
            for table in (tables.takes, tables.models):
                owned = select(func.count()).where(table.c.subject == name).select_from(table)
                if count := connection.scalar(owned):
                    raise Conflict(f"subject {name!r} still owns {count} {table.name}; remove those first")
            worn = update(tables.gloves).where(tables.gloves.c.subject == name)
            connection.execute(worn.values(subject=None, wearing=None))
            connection.execute(delete(tables.subjects).where(tables.subjects.c.name == name))
            tell_forgotten_subject(connection, name)


def require_subject(connection: Connection, name: str) -> SubjectRecord:
    """The subject, or NotFound."""
    row = connection.execute(select(tables.subjects).where(tables.subjects.c.name == name)).one_or_none()
    if row is None:
        every = connection.scalars(select(tables.subjects.c.name).order_by(tables.subjects.c.name))
        raise NotFound(
            f"there is no subject {name!r}; {did_you_mean(name, every)}. Add one: glovecal subject add {name}"
        )
    return _record(sound_row(tables.subjects, row))


def of_subject(table: Table, name: str) -> ColumnElement[bool]:
    """Rows of a person, and rows of nobody: their subject is damaged, and whoever reads them notices."""
    return (table.c.subject == name) | table.c.subject.not_in(select(tables.subjects.c.name))


def _record(values: Mapping[str, Any]) -> SubjectRecord:
    return SubjectRecord(**values)


def _dimensions(subject: str, dimensions: Mapping[str, float]) -> dict[str, float]:
    for name, value in dimensions.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not math.isfinite(value) or value <= 0:
            raise BadInput(
                f"dimension {name!r} of subject {subject!r} is {value!r}; give millimetres above 0"
            )
    try:
        HandDimensions.from_measured(dimensions)
    except BadInput as error:
        raise BadInput(f"subject {subject!r}: {error}") from error
    return {name: float(value) for name, value in dimensions.items()}


def _hand(subject: str, hand: Handedness) -> Handedness:
    if hand not in get_args(Handedness):
        raise BadInput(f"hand of subject {subject!r} is {hand!r}; give right or left")
    return hand
