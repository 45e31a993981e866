"""What changed last, for processes that follow the store: whoever looks again looks at that and nothing else.

A number grows with each change, and each thing that changed has the number of its last one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from sqlalchemy import Connection, delete, insert, select, update

from glovecal_service.store import tables
from glovecal_service.store.database import Database
from glovecal_service.store.errors import StoreDamaged

Kind = Literal["glove", "subject", "recording", "sampling", "everything"]

_NO_REVISION = "the revision of the store is missing; restore a backup of the database"


@dataclass(frozen=True)
class Changes:
    """Since a number that was told before."""

    revision: int
    """The number to ask with next."""
    everything: bool
    """Nobody knows what changed: look at all there is."""
    changed: frozenset[tuple[str, str]]

    def are_of(self, kind: Kind) -> bool:
        return self.everything or any(each == kind for each, _ in self.changed)

    def names(self, kind: Kind) -> set[str]:
        """Of gloves or subjects."""
        return {name for each, name in self.changed if each == kind}


def tell_change(connection: Connection, kind: Kind, name: str = "") -> None:
    """Inside the caller's transaction. Recordings and samplings have no name: there are few unsettled ones.

    The number's row is locked until that transaction ends, so changes come one after the other, on PostgreSQL
    too: who has read a number has missed none below it. Raises StoreDamaged.
    """
    grown = update(tables.revision).values(value=tables.revision.c.value + 1)
    value = connection.scalar(grown.returning(tables.revision.c.value))
    if value is None:
        raise StoreDamaged(_NO_REVISION)
    table = tables.changes
    connection.execute(delete(table).where((table.c.kind == kind) & (table.c.name == name)))
    connection.execute(insert(table).values(kind=kind, name=name, revision=value))


def tell_forgotten_subject(connection: Connection, name: str) -> None:
    """That a person is gone, whose name stays nowhere."""
    table = tables.changes
    connection.execute(delete(table).where((table.c.kind == "subject") & (table.c.name == name)))
    tell_change(connection, "everything")


def changes_since(database: Database, seen: int | None) -> Changes:
    """One query, cheap enough for ten a second. ``seen``: the number told last, None for one who starts.

    Raises StoreDamaged.
    """
    table = tables.changes
    newer = select(table.c.kind, table.c.name).where(table.c.revision > (-1 if seen is None else seen))
    with database.read() as connection:
        revision = connection.scalar(select(tables.revision.c.value))
        if not isinstance(revision, int):
            raise StoreDamaged(_NO_REVISION)
        if revision == seen:
            return Changes(revision, everything=False, changed=frozenset())
        changed = frozenset((row.kind, row.name) for row in connection.execute(newer))
    # a number that fell is that of a restored backup
    is_unknown = seen is None or revision < seen or ("everything", "") in changed
    return Changes(revision, everything=is_unknown, changed=changed)
