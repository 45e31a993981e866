"""The log of changes as it is read: newest first, whole, and whether it is what was written.

An entry that was edited (other than by erasing a subject), taken out or put elsewhere breaks the chain of
hashes, and one that is missing at its end does not fit the head.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select

from glovecal_service.store import tables
from glovecal_service.store.audit_trail import entry_sha256
from glovecal_service.store.database import Database
from glovecal_service.store.list_part import Listing, ListPart, Page

REWRITTEN = "audit"
"""Table of a change that says: an erasure took a subject out of that entry, and this is its hash now."""
PART = 1000
"""Entries that are read at once."""


@dataclass(frozen=True)
class AuditEntry:
    id: int
    at: datetime
    who: str
    origin: str
    action: str
    changes: list[dict[str, Any]]
    previous: str
    sha256: str


_LISTING = Listing(tables.audit, ("id",), newest_first=True, searched=("who", "origin", "action"))


class Audit:
    def __init__(self, database: Database) -> None:
        self._database = database

    def page(self, part: ListPart) -> Page[AuditEntry]:
        """A part of them, newest first."""
        with self._database.read() as connection:
            return _LISTING.page(connection, _entry, part)

    def every(self, after: int = 0) -> Iterator[AuditEntry]:
        """Those with higher ids, oldest first, in parts."""
        while True:
            statement = select(tables.audit).where(tables.audit.c.id > after).order_by(tables.audit.c.id)
            with self._database.read() as connection:
                part = [_entry(row._mapping) for row in connection.execute(statement.limit(PART))]
            if not part:
                return
            yield from part
            after = part[-1].id

    @property
    def count(self) -> int:
        """Entries that were written."""
        with self._database.read() as connection:
            return connection.scalar(select(tables.audit_head.c.count)) or 0

    def every_with_soundness(self) -> Iterator[tuple[AuditEntry, bool]]:
        """Oldest first; whether each says what was written, be it by an erasure (``REWRITTEN``)."""
        rewritten = self._rewritten()
        for entry in self.every():
            digest = entry_sha256(vars(entry))
            yield entry, digest in (entry.sha256, rewritten.get(entry.id))

    def _rewritten(self) -> dict[int, str]:
        """By entry: the hash of what it says since a subject was erased, as a later entry that is what was
        written has it."""
        digests = {}
        for entry in self.every():
            if entry.sha256 == entry_sha256(vars(entry)):
                for change in entry.changes:
                    if change["table"] == REWRITTEN and int(change["key"]) < entry.id:
                        digests[int(change["key"])] = change["after"]["sha256"]
        return digests

    def problems(self) -> list[str]:
        """What does not fit, a sentence each; none: the log is what was written. It may grow meanwhile."""
        before = self._head()
        wrong, count, previous, reached = [], 0, "", (0, "")
        for entry, is_sound in self.every_with_soundness():
            if entry.id != count + 1:
                wrong.append(f"entries {count + 1} to {entry.id - 1} are missing")
            elif entry.previous != previous:
                wrong.append(f"entry {entry.id} does not follow the one before it")
            if not is_sound:
                wrong.append(f"entry {entry.id} was changed after it was written")
            count, previous = entry.id, entry.sha256
            if count == before[0]:
                reached = count, previous
        if reached != before or count > self._head()[0]:
            wrong.append(f"the log ends with entry {count}, but {max(0, before[0])} were written")
        return wrong

    def _head(self) -> tuple[int, str]:
        """The number of entries that were written, and the hash of the last; -1 where nothing says so."""
        with self._database.read() as connection:
            columns = tables.audit_head.c.count.label("entries"), tables.audit_head.c.sha256
            head = connection.execute(select(*columns)).one_or_none()
        return (-1, "") if head is None else (head.entries, head.sha256)


def _entry(values: Mapping[Any, Any]) -> AuditEntry:
    changes = values["changes"]
    return AuditEntry(**{**values, "changes": getattr(changes, "document", changes)})
