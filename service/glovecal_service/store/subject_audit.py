"""What the log of changes says of one subject.

A name is looked for where a subject is named, never in any text: there are gloves, wearings and takes that
are called like a person.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

from glovecal_service.store import tables
from glovecal_service.store.audit import Audit, AuditEntry

SOMEBODY_ELSE = "another person"
_TAKES, _PEOPLE = tables.takes.name, tables.subjects.name
_WITH_IDS = {
    table.name for table in (tables.takes, tables.models, tables.recordings, tables.samplings, tables.jobs)
}


class SubjectAudit:
    def __init__(self, audit: Audit, name: str, ids: set[str]) -> None:
        """``ids``: of rows that are known to be of subject ``name``; those that are gone are found here."""
        self._audit = audit
        self._name = name
        self.ids = set(ids)
        self.artifacts: set[str] = set()
        """sha256 of all that its takes ever held."""
        for entry in audit.every():
            for change in entry.changes:
                self._learn(change)

    def entries(self) -> Iterator[AuditEntry]:
        """Those that speak of the subject, oldest first, as they were written."""
        return (entry for entry in self._audit.every() if self.concerns(entry))

    def own(self) -> Iterator[dict[str, Any]]:
        """The same for the subject itself: without what an entry says of others, who are not named."""
        for entry in self.entries():
            about = [change for change in entry.changes if self.is_about(change)]
            yield {
                "id": entry.id, "at": entry.at.isoformat(), "who": entry.who, "origin": entry.origin,
                "action": entry.action, "changes": [self._without_others(change) for change in about],
                "changes_of_others": len(entry.changes) - len(about), "sha256": entry.sha256,
            }  # fmt: skip

    def concerns(self, entry: AuditEntry) -> bool:
        return self.in_action(entry.action) or any(map(self.is_about, entry.changes))

    def in_action(self, action: str) -> bool:
        """Whether a request's path leads to the subject, or to what is its own."""
        parts = action.split("/")
        return f"/subjects/{self._name}/" in f"{action}/" or any(part in self.ids for part in parts)

    def is_about(self, change: Mapping[str, Any]) -> bool:
        keys = str(change.get("key", "")).split("/")
        if change.get("table") == _PEOPLE:
            return self._name in keys
        return any(key in self.ids for key in keys) or names_subject(
            [change.get("before"), change.get("after")], self._name
        )

    def without_subject(self, entry: AuditEntry, stand_in: str, value: str) -> AuditEntry:
        """The entry with ``stand_in`` for the subject's name, and ``value`` for what was kept of it; what it
        says of others is as it was."""
        action = "/".join(
            stand_in if part == self._name and before == "subjects" else part
            for before, part in pairwise(["", *entry.action.split("/")])
        )
        changes = [
            self._without_values(change, stand_in, value) if self.is_about(change) else change
            for change in entry.changes
        ]
        return replace(entry, action=action, changes=changes)

    def _without_values(self, change: Mapping[str, Any], stand_in: str, value: str) -> dict[str, Any]:
        """Rows of gloves and keys are of others too: there the name alone goes, and how it wore the glove."""
        is_shared = change["table"] in (tables.gloves.name, tables.keys.name)
        kept = dict(change)
        if change["table"] == _PEOPLE:
            kept["key"] = stand_in
        for side in ("before", "after"):
            if isinstance(values := change.get(side), Mapping):
                is_own = not is_shared or values.get("subject") == self._name
                gone = ("wearing",) if is_shared else tuple(values)
                kept[side] = {
                    key: value
                    if is_own and key in gone and key != "subject"
                    else _renamed(key, item, self._name, stand_in)
                    for key, item in values.items()
                }
        return kept

    def _learn(self, change: Mapping[str, Any]) -> None:
        """Rows that were the subject's once."""
        for values in (change.get("before") or {}, change.get("after") or {}):
            if values.get("subject") == self._name and change["table"] in _WITH_IDS:
                self.ids.add(str(change["key"]))
        for values in (change.get("before") or {}, change.get("after") or {}):
            if change["table"] == _TAKES and change["key"] in self.ids and "artifact" in values:
                self.artifacts.add(str(values["artifact"]))

    def _without_others(self, change: Mapping[str, Any]) -> dict[str, Any]:
        return {
            key: _others_hidden(value, self._name) if key in ("before", "after") else value
            for key, value in change.items()
        }


def names_subject(value: Any, name: str) -> bool:
    """Whether it has a field ``subject`` or ``subjects`` with that name, however deep."""
    if isinstance(value, Mapping):
        own = value.get("subjects")
        if value.get("subject") == name or (isinstance(own, list) and name in own):
            return True
        return any(names_subject(item, name) for item in value.values())
    return isinstance(value, list) and any(names_subject(item, name) for item in value)


def _renamed(key: str, item: Any, name: str, stand_in: str) -> Any:
    if key == "subjects" and isinstance(item, list):
        return [stand_in if each == name else each for each in item]
    return stand_in if key == "subject" and item == name else item


def _others_hidden(value: Any, name: str) -> Any:
    if isinstance(value, list):
        return [_others_hidden(item, name) for item in value]
    if not isinstance(value, Mapping):
        return value
    shown = {}
    for key, item in value.items():
        if key == "subject" and isinstance(item, str) and item != name:
            item = SOMEBODY_ELSE
        elif key == "subjects" and isinstance(item, list):
            item = [each if each == name else SOMEBODY_ELSE for each in item]
        shown[key] = _others_hidden(item, name)
    return shown
