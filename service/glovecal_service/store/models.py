"""Calibration models and which of them is active: immutable artifacts, an append-only list of activations."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from sqlalchemy import ColumnElement, CompoundSelect, Connection, func, select, union
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement
from sqlalchemy.types import NullType

from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.hand.rotations import HANDS, Handedness, is_of_hand, known_hand
from glovecal_models.names import check_identifier
from glovecal_service.store import tables
from glovecal_service.store.blobs import Artifacts
from glovecal_service.store.changes import tell_change
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.list_part import WHOLE, Listing, ListPart, Page, is_of_hand_in
from glovecal_service.store.records import NAME, NOTE, REMOVED, Activation, ModelRecord
from glovecal_service.store.row_hash import add_row, change_rows, sort_out, sound_row, sound_rows
from glovecal_service.store.subjects import of_subject, require_subject

SHORTEST_PREFIX = 6
_LISTING = Listing(
    tables.models,
    searched=("^id", "subject", "layout", "method", "facts.name", "facts.note", "facts.effects"),
)
_PREFIX = re.compile(r"[0-9a-f]{6,64}\Z")


class Models:
    def __init__(self, database: Database, artifacts: Artifacts) -> None:
        self._database = database
        self._artifacts = artifacts

    def add(
        self,
        artifact: bytes,
        *,
        subject: str,
        layout: str,
        method: str,
        parent: str | None,
        facts: Mapping[str, Any],
        hand: Handedness | None = None,
    ) -> ModelRecord:
        """Keep a model; its id is the sha256 of its artifact. The very same again gives the record there is.

        ``facts["takes"]`` lists the ids of the takes it was trained on (texts, or objects with ``id``);
        ``facts["effects"]`` becomes the names of the artifact's effects, if it has any. Without ``hand`` it
        is of the parent's.
        Raises NotFound (subject or parent), Conflict (same bytes under another subject), StorageFull.
        """
        record = ModelRecord(
            id=self._artifacts.put(artifact),
            subject=subject,
            layout=check_identifier(layout, "layout"),
            method=check_identifier(method, "method"),
            parent=parent,
            facts={**facts, **_effect_names(artifact)},
            created_at=now(),
        )
        takes = _take_ids(facts.get("takes", ()))
        with self._database.write() as connection:
            require_subject(connection, subject)
            before = None if parent is None else _one(connection, parent)
            record = replace(record, hand=hand or (before and before.hand))
            if earlier := _find(connection, record.id):
                if (earlier.subject, earlier.layout) != (subject, layout):
                    raise Conflict(
                        f"model {record.id[:12]} belongs to subject {earlier.subject!r} with layout"
                        f" {earlier.layout!r} already"
                    )
                return _changed(connection, earlier, {REMOVED: None}) if earlier.is_removed else earlier
            add_row(connection, tables.models, record.__dict__)
            for take in takes:
                add_row(connection, tables.model_takes, {"model": record.id, "take": take})
        return record

    def get(self, id: str) -> ModelRecord:
        """By id or a prefix of at least 6 digits that only one model has. Raises NotFound, Conflict."""
        with self._database.read() as connection:
            return _one(connection, id)

    def describe(self, id: str, *, name: str, note: str) -> ModelRecord:
        """What people call it; "" for nothing. Raises NotFound, Conflict."""
        return self._with_facts(id, {NAME: name, NOTE: note})

    def remove(self, id: str) -> ModelRecord:
        """Leave it out of lists. What was made of it stays, and ``restore`` undoes it. Raises NotFound,
        Conflict for one that is active."""
        model = self.get(id)
        if self.is_active(model):
            raise Conflict(
                f"model {model.id[:12]} is active: live poses of {model.subject} come from it. Activate "
                f"another one first, or roll back: glovecal model rollback --subject {model.subject}"
            )
        return self._with_facts(model.id, {REMOVED: now().isoformat()})

    def restore(self, id: str) -> ModelRecord:
        """Raises NotFound, Conflict."""
        return self._with_facts(id, {REMOVED: None})

    def _with_facts(self, id: str, facts: Mapping[str, Any]) -> ModelRecord:
        with self._database.write() as connection:
            found = _one(connection, id)
            return _changed(connection, found, facts)

    def list(
        self,
        subject: str | None = None,
        layout: str | None = None,
        *,
        removed: bool = False,
        part: ListPart = WHOLE,
    ) -> list[ModelRecord]:
        """Models in the order they were added; with ``removed`` those that were taken out."""
        is_removed = IsRemoved(tables.models.c.facts)
        mine = None if subject is None else of_subject(tables.models, subject)
        chosen = _LISTING.every(is_removed if removed else ~is_removed, mine, part=part)
        with self._database.read() as connection:
            wanted = {"subject": subject, "layout": layout}
            return sound_rows(connection, tables.models, chosen, _record, wanted)

    def page(
        self,
        part: ListPart,
        *,
        subject: str | None = None,
        layout: str | None = None,
        hand: Handedness | None = None,
        removed: bool = False,
    ) -> Page[ModelRecord]:
        """A part of them, oldest first; of one hand those too of which nobody said whose they are."""
        own, is_removed = tables.models.c, IsRemoved(tables.models.c.facts)
        with self._database.read() as connection:
            return _LISTING.page(
                connection, _record, part,
                None if subject is None else own.subject == subject,
                None if layout is None else own.layout == layout,
                is_of_hand_in(own.hand, hand),
                is_removed if removed else None,
                hidden=None if removed else is_removed,
            )  # fmt: skip

    def count(self, subject: str | None = None) -> int:
        """How many there are of a subject (None: of all) that were not removed."""
        own = select(func.count()).select_from(tables.models)
        if subject is not None:
            own = own.where(tables.models.c.subject == subject)
        with self._database.read() as connection:
            removed = connection.scalar(own.where(IsRemoved(tables.models.c.facts))) or 0
            return (connection.scalar(own) or 0) - removed

    def lineage(self, id: str) -> list[ModelRecord]:
        """The model, its parent, the parent's parent ... Raises NotFound."""
        with self._database.read() as connection:
            line = [_one(connection, id)]
            while parent := line[-1].parent:
                line.append(_one(connection, parent))
            return line

    def load_bytes(self, id: str) -> bytes:
        """The artifact, verified. Raises NotFound, Conflict, DamagedArtifact."""
        return self._artifacts.get(self.get(id).id)

    def activate(self, id: str) -> Activation:
        """Let the model speak for its subject, layout and hand from now on.

        The artifact is verified first; if that fails, whatever was active stays so. Raises NotFound,
        Conflict, DamagedArtifact.
        """
        model = self.get(id)
        self._artifacts.get(model.id)
        with self._database.write() as connection:
            tell_change(connection, "subject", model.subject)
            earlier = _current(connection, model.subject, model.layout, model.hand)
            if earlier is not None and earlier.model == model.id:
                if earlier.id == _newest(connection, model.subject):
                    return earlier
                return _append(connection, model, "activate", earlier.previous)
            previous = None if earlier is None else earlier.id
            return _append(connection, model, "activate", previous)

    def rollback(self, subject: str, layout: str, hand: Handedness | None = None) -> Activation:
        """Return to the model that was active before; again, to the one before that.

        Raises Conflict when nothing earlier was active, and without ``hand`` where both hands have a model
        of their own; DamagedArtifact if the earlier one is damaged.
        """
        if hand is None and len(self.active_of_each_hand(subject, layout)) > 1:
            raise Conflict(
                f"subject {subject!r} has an active model of each hand with layout {layout!r}; say "
                "which hand: --hand left or --hand right"
            )
        with self._database.write() as connection:
            tell_change(connection, "subject", subject)
            current = _current(connection, subject, layout, hand)
            target = None if current is None else _before(connection, current, hand)
            if target is None:
                raise Conflict(f"nothing earlier was active for subject {subject!r} with layout {layout!r}")
            self._artifacts.get(target.model)
            return _append(connection, _one(connection, target.model), "rollback", target.previous)

    def active(self, subject: str, layout: str, hand: Handedness | None = None) -> ModelRecord | None:
        """The model that speaks for that hand of the subject with that layout, None if none does.

        The newest of the hand's own and of those whose takes do not say; without ``hand`` the newest of all.
        Where the hand has none of its own and the newest of all is of the other hand, none does.
        """
        with self._database.read() as connection:
            hands = _hands(connection, subject, layout)
            current = _current(connection, subject, layout, hand if hand in hands else None)
            if current is None or not is_of_hand(current.hand, hand):
                return None
            return _one(connection, current.model)

    def active_of_each_hand(self, subject: str, layout: str) -> list[ModelRecord]:
        """One, or two where the hands have models of their own."""
        with self._database.read() as connection:
            hands = _hands(connection, subject, layout)
        each = [self.active(subject, layout, hand) for hand in sorted(hands) or [None]]
        return list({record.id: record for record in each if record is not None}.values())

    def is_active(self, model: ModelRecord) -> bool:
        """Whether it speaks for its subject with its layout, be it for one hand."""
        return any(each.id == model.id for each in self.active_of_each_hand(model.subject, model.layout))

    def active_among(self, models: Iterable[ModelRecord]) -> tuple[set[str], list[str]]:
        """Ids of those that are active, and a sentence on each activation that is damaged."""
        models = list(models)
        subjects = sorted({model.subject for model in models})
        table = tables.activations
        with self._database.read() as connection:
            newest = select(_active_activations(subjects).subquery().c.id)
            found = connection.execute(select(table).where(table.c.id.in_(newest))).all()
        activations, damaged = sort_out(table, found, _activation_record)
        return {model.id for model in models} & {each.model for each in activations}, damaged

    def count_active(self, subject: str | None = None) -> int:
        """How many speak for a subject (None: for all), a layout and a hand."""
        chosen = _active_activations(None if subject is None else [subject]).subquery()
        with self._database.read() as connection:
            return connection.scalar(select(func.count()).select_from(chosen)) or 0

    def damage(self, model: ModelRecord) -> str:
        """Why the model's artifact cannot be loaded, and what to do; "" while it is what was stored."""
        try:
            self._artifacts.verify(model.id)
        except (DamagedArtifact, NotFound) as error:
            return self._damage(model, error)
        return ""

    def damage_of(self, row: dict[str, Any]) -> str:
        """The same of a row, which was checked, and by reading the artifact in any case. "" for one that was
        removed."""
        model = _record(row)
        try:
            if not model.is_removed:
                self._artifacts.get(model.id)
        except (DamagedArtifact, NotFound) as error:
            return self._damage(model, error)
        return ""

    def _damage(self, model: ModelRecord, error: Exception) -> str:
        with self._database.read() as connection:
            current = _current(connection, model.subject, model.layout, model.hand)
        active = current if current is not None and current.model == model.id else None
        remedies = other_remedies(model, can_roll_back=active is not None and active.previous is not None)
        remove = "" if active else f", or remove it: glovecal model remove {model.id[:12]}"
        return f"model {model.id[:12]} cannot be loaded: {error}{remedies}{remove}"

    def activations(self, subject: str, layout: str) -> list[Activation]:
        """What was active since when, oldest first."""
        table = tables.activations
        statement = select(table).where(_concerns(subject)).order_by(table.c.id)
        wanted = {"subject": subject, "layout": layout}
        with self._database.read() as connection:
            return sound_rows(connection, table, statement, _activation_record, wanted)


def other_remedies(model: ModelRecord, *, can_roll_back: bool) -> str:
    """What helps against a damaged model where there is no backup, as the end of a sentence."""
    hand = f" --hand {model.hand}" if model.hand else ""
    back = (
        f", or return to the model before it: glovecal model rollback --subject {model.subject} --layout "
        f"{model.layout}{hand}"
    )
    return f"{back if can_roll_back else ''}, or train again: glovecal train --subject {model.subject}{hand}"


def _effect_names(artifact: bytes) -> dict[str, list[str]]:
    """So that models can be listed without opening their artifacts."""
    from glovecal_models.calibration.artifact import read_manifest  # slow to load, and seldom needed

    try:
        effects = read_manifest(artifact).get("effects")
    except DamagedArtifact:
        return {}
    return {"effects": [item["name"] for item in effects]} if effects else {}


class IsRemoved(FunctionElement[Any]):
    """Whether people took it out, as the index of those says it; a Boolean would be compared with 1."""

    type = NullType()
    inherit_cache = True


@compiles(IsRemoved)
def _on_sqlite(element: IsRemoved, compiler: Any, **options: Any) -> str:
    return f"({tables.IS_REMOVED['sqlite']})"


@compiles(IsRemoved, "postgresql")
def _on_postgresql(element: IsRemoved, compiler: Any, **options: Any) -> str:
    return f"({tables.IS_REMOVED['postgresql']})"


def _find(connection: Connection, id: str) -> ModelRecord | None:
    row = connection.execute(select(tables.models).where(tables.models.c.id == id)).one_or_none()
    return None if row is None else _record(sound_row(tables.models, row))


def _one(connection: Connection, id: str) -> ModelRecord:
    if not _PREFIX.match(id):
        raise NotFound(
            f"{id[:80]!r} is no model id: give at least {SHORTEST_PREFIX} of its hexadecimal digits"
        )
    matching = tables.models.c.id.startswith(id)
    rows = connection.execute(select(tables.models).where(matching).limit(2)).all()
    if not rows:
        raise NotFound(f"there is no model {id!r}. List them: glovecal model list")
    if len(rows) > 1:
        raise Conflict(f"more than one model starts with {id!r}; give more digits")
    return _record(sound_row(tables.models, rows[0]))


def _record(values: dict[str, Any]) -> ModelRecord:
    return ModelRecord(**values)


def _current(connection: Connection, subject: str, layout: str, hand: Handedness | None) -> Activation | None:
    table = tables.activations
    newest_first = select(table).where(_concerns(subject)).order_by(table.c.id.desc())
    for row in connection.execute(newest_first):
        found = _activation_record(sound_row(table, row))
        if (found.subject, found.layout) == (subject, layout) and is_of_hand(found.hand, hand):
            return found
    return None


def _hands(connection: Connection, subject: str, layout: str) -> set[Handedness]:
    """Those that models of the subject with that layout are known to be of."""
    table = tables.models
    statement = select(table.c.hand).where(table.c.subject == subject, table.c.layout == layout)
    hands = map(known_hand, connection.scalars(statement.distinct()))
    return {hand for hand in hands if hand is not None}


def _before(connection: Connection, current: Activation, hand: Handedness | None) -> Activation | None:
    """What rolling back leads to."""
    while current.previous is not None:
        current = _activation(connection, current.previous)
        if is_of_hand(current.hand, hand):
            return current
    return None


def _concerns(subject: str) -> ColumnElement[bool]:
    """Activations that are the subject's, or were before a damage: of all layouts, and of its models."""
    own = select(tables.models.c.id).where(tables.models.c.subject == subject)
    return of_subject(tables.activations, subject) | tables.activations.c.model.in_(own)


def _active_activations(subjects: Sequence[str] | None) -> CompoundSelect[Any]:
    """Ids of what ``active_of_each_hand`` finds for each subject and layout, without reading a row."""
    table, models = tables.activations, tables.models
    newest = select(table.c.subject, table.c.layout, table.c.hand, func.max(table.c.id).label("id")).group_by(
        table.c.subject, table.c.layout, table.c.hand
    )
    known = (
        select(models.c.subject, models.c.layout, models.c.hand).where(models.c.hand.in_(HANDS)).distinct()
    )
    if subjects is not None:
        newest = newest.where(table.c.subject.in_(subjects))
        known = known.where(models.c.subject.in_(subjects))
    newest, known = newest.subquery("newest"), known.subquery("known")
    same = (newest.c.subject == known.c.subject) & (newest.c.layout == known.c.layout)
    of_hand = newest.c.hand.is_(None) | (newest.c.hand == known.c.hand)
    by_hand = (
        select(func.max(newest.c.id).label("id"))
        .join_from(known, newest, same & of_hand)
        .group_by(known.c.subject, known.c.layout, known.c.hand)
    )
    of_both = (
        select(func.max(newest.c.id).label("id"))
        .join_from(newest, known, same, isouter=True)
        .where(known.c.hand.is_(None))
        .group_by(newest.c.subject, newest.c.layout)
    )
    return union(by_hand, of_both)


def _newest(connection: Connection, subject: str) -> int | None:
    """Of all layouts: layouts of the same sensors compete for a glove."""
    table = tables.activations
    return connection.scalar(select(func.max(table.c.id)).where(table.c.subject == subject))


def _activation(connection: Connection, id: int) -> Activation:
    row = connection.execute(select(tables.activations).where(tables.activations.c.id == id)).one_or_none()
    if row is None:
        raise NotFound(f"activation {id} is missing from the database")
    return _activation_record(sound_row(tables.activations, row))


def _changed(connection: Connection, model: ModelRecord, facts: Mapping[str, Any]) -> ModelRecord:
    """``facts`` that are None are taken out."""
    kept = {**model.facts, **facts}
    kept = {key: value for key, value in kept.items() if value is not None or key not in facts}
    change_rows(connection, tables.models, tables.models.c.id == model.id, {"facts": kept})
    return replace(model, facts=kept)


def _append(connection: Connection, model: ModelRecord, kind: str, previous: int | None) -> Activation:
    if model.is_removed:
        _changed(connection, model, {REMOVED: None})
    values = {
        "subject": model.subject,
        "layout": model.layout,
        "model": model.id,
        "kind": kind,
        "previous": previous,
        "hand": model.hand,
        "created_at": now(),
    }
    return Activation(id=add_row(connection, tables.activations, values), **values)


def _activation_record(values: dict[str, Any]) -> Activation:
    return Activation(**values)


def _take_ids(takes: Iterable[Any]) -> list[str]:
    ids = [take["id"] if isinstance(take, Mapping) else take for take in takes]
    for id in ids:
        if not isinstance(id, str):
            raise BadInput(f'facts["takes"] must list the ids of takes, not {id!r}')
    return sorted(set(ids))
