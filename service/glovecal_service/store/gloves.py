"""Gloves seen on the network, and who wears them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, Row, delete, func, insert, select, update

from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier, subject_name
from glovecal_models.takes.take import KnownLatency
from glovecal_service.store import tables
from glovecal_service.store.changes import tell_change
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.records import OPEN_RECORDING_STATES, GloveRecord, TakeRecord
from glovecal_service.store.row_hash import sound_row, sound_rows
from glovecal_service.store.subjects import require_subject
from glovecal_service.store.texts import check_text

MOST_GLOVES = 256
MOST_DELAY_MS = 500
"""After it, more frames change nothing."""
MOST_META_BYTES = 65_536
"""As much as the router lets through at once."""
_WEARER = ("layout", "subject", "wearing", "hand")


class Gloves:
    def __init__(self, database: Database) -> None:
        self._database = database

    def seen(self, glove: str, meta: Mapping[str, Any]) -> GloveRecord:
        """Note the meta message of a glove's capture daemon (the wire contract's ``meta`` JSON).

        The later word on who wears the glove counts: a wearer chosen with ``assign`` stays through the run
        of the daemon in which it was chosen; the subject in the meta of a later run replaces it. The subject
        may be one the store does not know yet. Raises BadInput for a meta that cannot be one, Conflict where
        ``MOST_GLOVES`` are stored already.
        """
        said = _said(check_identifier(glove, "glove"), meta)
        with self._database.write() as connection:
            earlier = _find(connection, glove)
            if earlier is None:
                _add(connection, {**said, "name": glove, "first_seen_at": said["last_seen_at"]})
                tell_change(connection, "glove", glove)
            else:
                _keep_chosen_wearer(said, earlier)
                _change(connection, glove, said)
                if any(said[name] != getattr(earlier, name) for name in _WEARER):
                    tell_change(connection, "glove", glove)
            return _record(sound_row(tables.gloves, _require(connection, glove)))

    def with_meta(self, glove: str, meta: Mapping[str, Any] | None) -> GloveRecord:
        """The glove as ``seen`` would leave it, but nothing is stored; without a meta as it is. Raises
        BadInput."""
        changes = _said(check_identifier(glove, "glove"), meta) if meta else {}
        with self._database.read() as connection:
            earlier = _find(connection, glove)
            stored = {} if earlier is None else sound_row(tables.gloves, earlier)
        if changes and earlier is not None:
            _keep_chosen_wearer(changes, earlier)
        nothing = dict.fromkeys(("layout", "subject", "wearing", "assigned_at", "latency")) | {"delay_ms": 0}
        return _record({**nothing, **_unseen(glove, now()), **stored, **changes})

    def remove(self, name: str) -> None:
        """Forget the glove and who wears it; its takes and recordings stay. Raises NotFound, Conflict while
        a recording of it is not settled."""
        table = tables.recordings
        unsettled = (table.c.glove == name) & table.c.state.in_((*OPEN_RECORDING_STATES, "repairing"))
        with self._database.write() as connection:
            _require(connection, name)
            recording = connection.execute(select(table.c.name, table.c.state).where(unsettled)).first()
            if recording is not None:
                raise Conflict(
                    f"recording {recording.name!r} of glove {name!r} is {recording.state}; remove the glove "
                    "once that is done"
                )
            connection.execute(delete(tables.gloves).where(tables.gloves.c.name == name))
            tell_change(connection, "glove", name)

    def names(self) -> set[str]:
        """Of all gloves."""
        with self._database.read() as connection:
            return set(connection.scalars(select(tables.gloves.c.name)))

    def get(self, name: str) -> GloveRecord:
        """Raises NotFound."""
        with self._database.read() as connection:
            return _record(sound_row(tables.gloves, _require(connection, name)))

    def list(self) -> list[GloveRecord]:
        """All gloves by name."""
        with self._database.read() as connection:
            statement = select(tables.gloves).order_by(tables.gloves.c.name)
            return sound_rows(connection, tables.gloves, statement, _record)

    def assign(self, glove: str, subject: str | None, wearing: str | None = None) -> GloveRecord:
        """Say who wears the glove from now on; None for nobody. The glove need not have been seen yet.

        Raises BadInput for bad names, NotFound for an unknown subject, Conflict where ``MOST_GLOVES`` are
        stored already.
        """
        check_identifier(glove, "glove")
        if wearing is not None:
            check_text(wearing, f"wearing of glove {glove!r}")
        with self._database.write() as connection:
            if subject is not None:
                require_subject(connection, subject)
            earlier, at = _find(connection, glove), now()
            if earlier is None:
                _add(connection, _unseen(glove, at))
            chosen = {
                "subject": subject,
                "wearing": wearing,
                "assigned_at": at,
                "assigned_run_id": earlier.run_id if earlier else None,
            }
            _change(connection, glove, chosen)
            tell_change(connection, "glove", glove)
            return _record(sound_row(tables.gloves, _require(connection, glove)))

    def set_latency(self, glove: str, latency: Mapping[str, Any] | None) -> GloveRecord:
        """Keep how late the glove was measured to be, ``latency_s`` and ``sd_s`` in seconds and what else is
        to be known of it; None forgets it. The glove need not have been seen yet. Raises BadInput,
        Conflict where ``MOST_GLOVES`` are stored already."""
        return self._set(glove, {"latency": None if latency is None else dict(latency)})

    def set_delay(self, glove: str, delay_ms: int) -> GloveRecord:
        """Have live poses wait so long for the frames after them. The glove need not have been seen yet.
        Raises BadInput, Conflict where ``MOST_GLOVES`` are stored already."""
        if not 0 <= delay_ms <= MOST_DELAY_MS:
            raise BadInput(f"delay of glove {glove!r}: {delay_ms} ms; choose 0 to {MOST_DELAY_MS}")
        return self._set(glove, {"delay_ms": delay_ms})

    def _set(self, glove: str, values: Mapping[str, Any]) -> GloveRecord:
        check_identifier(glove, "glove")
        with self._database.write() as connection:
            if _find(connection, glove) is None:
                _add(connection, _unseen(glove, now()))
            _change(connection, glove, values)
            tell_change(connection, "glove", glove)
            return _record(sound_row(tables.gloves, _require(connection, glove)))


def latency_of_take(connection: Connection, take: TakeRecord) -> KnownLatency | None:
    """Of the glove that the take was recorded with; of a file that of its subject's only such glove."""
    table = tables.gloves
    recording = select(tables.recordings.c.glove).where(tables.recordings.c.id == take.recording)
    glove = connection.execute(recording).scalar() if take.recording else None
    if glove is None:
        mine = (table.c.subject == take.subject) & (table.c.layout == take.layout)
    else:
        mine = table.c.name == glove
    rows = connection.execute(select(table).where(mine)).all()
    found = [_record(sound_row(table, row)).known_latency for row in rows]
    known = [item for item in found if item is not None]
    return known[0] if len(known) == 1 else None


def _said(glove: str, meta: Mapping[str, Any]) -> dict[str, Any]:
    size = len(json.dumps(dict(meta), default=str))
    if size > MOST_META_BYTES:
        raise BadInput(f"meta of glove {glove!r}: {size} bytes; at most {MOST_META_BYTES} are kept")
    layout, subject, wearing = meta.get("layout"), meta.get("subject"), meta.get("wearing")
    run_id = meta.get("run_id")
    if layout is not None:
        check_identifier(_text(layout, "layout", glove), f"layout of glove {glove!r}")
    if subject is not None:
        subject = subject_name(_text(subject, "subject", glove))
    if wearing is not None:
        check_text(wearing, f"wearing of glove {glove!r}")
    return {
        "layout": layout,
        "subject": subject,
        "wearing": wearing,
        "hand": _text(meta.get("hand") or "unknown", "hand", glove)[:16],
        "simulated": bool(meta.get("simulated", False)),
        "meta": dict(meta),
        "run_id": None if run_id is None else _text(run_id, "run_id", glove)[:32],
        "last_seen_at": now(),
    }


def _text(value: Any, what: str, glove: str) -> str:
    if not isinstance(value, str):
        raise BadInput(f"meta of glove {glove!r}: {what} must be text, not {value!r}")
    return check_text(value, f"meta of glove {glove!r}: {what}")


def _keep_chosen_wearer(said: dict[str, Any], earlier: Row) -> None:
    same_run = said["run_id"] == earlier.assigned_run_id
    chosen = earlier.assigned_at is not None and (same_run or said["subject"] is None)
    if chosen:
        said["subject"] = earlier.subject
        said["wearing"] = earlier.wearing if earlier.wearing is not None else said["wearing"]
    else:
        said["assigned_at"] = said["assigned_run_id"] = None


def _unseen(glove: str, at: datetime) -> dict[str, Any]:
    return {
        "name": glove,
        "hand": "unknown",
        "simulated": False,
        "meta": {},
        "first_seen_at": at,
        "last_seen_at": at,
    }


def _add(connection: Connection, values: Mapping[str, Any]) -> None:
    count = connection.scalar(select(func.count()).select_from(tables.gloves)) or 0
    if count >= MOST_GLOVES:
        raise Conflict(
            f"{MOST_GLOVES} gloves are stored, no more can be; remove one that is not needed: "
            "glovecal glove remove NAME"
        )
    connection.execute(insert(tables.gloves).values(**values))


def _change(connection: Connection, glove: str, values: Mapping[str, Any]) -> None:
    connection.execute(update(tables.gloves).where(tables.gloves.c.name == glove).values(**values))


def _find(connection: Connection, glove: str) -> Row | None:
    return connection.execute(select(tables.gloves).where(tables.gloves.c.name == glove)).one_or_none()


def _require(connection: Connection, glove: str) -> Row:
    row = _find(connection, glove)
    if row is None:
        raise NotFound(f"no glove {glove!r} was ever seen")
    return row


def _record(values: Mapping[str, Any]) -> GloveRecord:
    hidden = ("run_id", "assigned_run_id")
    return GloveRecord(**{name: value for name, value in values.items() if name not in hidden})
