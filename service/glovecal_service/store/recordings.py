"""Recordings that somebody asked for; the real-time process carries them out and reports here."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import ColumnElement, Connection, select

from glovecal_models.errors import BadInput
from glovecal_models.names import check_identifier, did_you_mean
from glovecal_service.store import tables
from glovecal_service.store.changes import tell_change
from glovecal_service.store.database import Database, new_id, now
from glovecal_service.store.errors import Conflict, NotFound, TakenOver
from glovecal_service.store.list_part import Listing, ListPart, Page
from glovecal_service.store.records import (
    OPEN_RECORDING_STATES,
    TIME_CODE,
    RecordingRecord,
    RecordingState,
)
from glovecal_service.store.row_hash import add_row, change_rows, sound_row, sound_rows
from glovecal_service.store.subjects import require_subject
from glovecal_service.store.texts import check_text

_LISTING = Listing(
    tables.recordings, ("requested_at", "id"), newest_first=True,
    searched=("^id", "glove", "name", "subject", "wearing", "state"),
)  # fmt: skip
PRE_ROLL = "pre_roll"
"""Fact of a recording: how much of the time before it was asked for, and came."""
PRE_ROLL_BEFORE = "lead_in"
"""The same in data folders from before 2026-11-22."""
STOP_ASKED = "stop_asked_s"
"""Fact of a recording: when its end was asked for, Unix seconds of the service's clock."""
TRIGGER = "trigger"
"""Fact of a recording that another system's trigger began, and of its take: what the trigger said at its
``start`` and at its ``stop``, and when it came."""
ENDED_BY = "ended_by"
"""Fact of a recording whose end nobody asked for: what ended it."""
KEEPER = "keeper"
"""Fact of a recording that began: computer and folder of the recorder that has its file."""
PRE_ROLL_S = 60.0
LONGEST_PRE_ROLL_S = 600.0

_ORDER: dict[str, int] = {
    "requested": 0,
    "recording": 1,
    "stopping": 2,
    "repairing": 3,
    "done": 4,
    "failed": 4,
}


_STOPPING = _ORDER["stopping"]


class Recordings:
    def __init__(self, database: Database) -> None:
        self._database = database

    def request(
        self,
        glove: str,
        *,
        name: str,
        subject: str | None = None,
        wearing: str | None = None,
        lead_s: float = PRE_ROLL_S,
        trigger: Mapping[str, Any] | None = None,
    ) -> RecordingRecord:
        """Ask for a recording; subject and wearing default to the glove's at this moment.

        ``lead_s`` seconds before it are to be in it too, as far as they were captured. ``trigger``: what
        another system said, that began it. Raises BadInput
        (names, a pre-roll that is negative or longer than ``LONGEST_PRE_ROLL_S``), NotFound (glove never
        seen, unknown subject), Conflict if the glove is being recorded already.
        """
        check_identifier(glove, "glove")
        check_text(name, "name of the recording")
        if wearing is not None:
            check_text(wearing, f"wearing of recording {name!r}")
        if not 0.0 <= lead_s <= LONGEST_PRE_ROLL_S:
            raise BadInput(
                f"pre-roll of recording {name!r}: {lead_s:g} s; 0 to {LONGEST_PRE_ROLL_S:g} s are possible"
            )
        at, id = now(), new_id()
        with self._database.write() as connection:
            tell_change(connection, "recording")
            worn = connection.execute(
                select(tables.gloves).where(tables.gloves.c.name == glove)
            ).one_or_none()
            if worn is None:
                raise NotFound(f"no glove {glove!r} was ever seen")
            if open_one := _open_recording(connection, glove):
                raise Conflict(f"glove {glove!r} is being recorded already ({open_one.name}, {open_one.id})")
            if subject is not None:
                require_subject(connection, subject)
            values = {
                "id": id,
                "glove": glove,
                "name": name,
                "subject": subject if subject is not None else worn.subject,
                "wearing": wearing if wearing is not None else worn.wearing,
                "state": "requested",
                "facts": {PRE_ROLL: {"asked_s": lead_s}}
                | ({} if trigger is None else {TRIGGER: {"start": dict(trigger)}}),
                "requested_at": at,
                "updated_at": at,
            }
            add_row(connection, tables.recordings, values)
            return _require(connection, id)

    def stop(
        self, id: str, *, name: str | None = None, trigger: Mapping[str, Any] | None = None
    ) -> RecordingRecord:
        """Ask for the end of a recording; asking again, or after its end, changes nothing.

        ``name``: what it and its take are called from now on; ``trigger``: what another system said, that
        ended it. Raises NotFound, BadInput.
        """
        if name is not None:
            check_text(name, "name of the recording")
        with self._database.write() as connection:
            tell_change(connection, "recording")
            before = _require(connection, id)
            if _ORDER[before.state] >= _STOPPING:
                return before
            asked: dict[str, Any] = {STOP_ASKED: time.time()}
            if trigger is not None:
                asked[TRIGGER] = {**before.facts.get(TRIGGER, {}), "stop": dict(trigger)}
            return _move(connection, id, "stopping", asked, name)

    def note_time_code(self, id: str, code: Mapping[str, Any]) -> RecordingRecord:
        """A SMPTE time code that was heard while it goes on, and when; its take will have it.

        Raises NotFound, and Conflict where its take is there already.
        """
        with self._database.write() as connection:
            record = _require(connection, id)
            if record.state not in OPEN_RECORDING_STATES:
                raise Conflict(
                    f"recording {record.name!r} is over; say it of its take: PUT /v1/takes/ID/time-code"
                )
            return _move(connection, id, None, {TIME_CODE: dict(code)})

    def take_over(self, seen: RecordingRecord, keeper: str) -> RecordingRecord:
        """Let a recorder go on with what another one began and has not reported on since it was ``seen``.

        Raises NotFound, TakenOver where somebody did.
        """

        def change(row: dict[str, Any]) -> dict[str, Any]:
            if row["updated_at"] != seen.updated_at:
                raise TakenOver(f"recording {seen.name!r} is reported on by another recorder")
            return {"facts": {**row["facts"], KEEPER: keeper}, "updated_at": now()}

        with self._database.write() as connection:
            change_rows(connection, tables.recordings, tables.recordings.c.id == seen.id, change)
            return _require(connection, seen.id)

    def update(
        self, id: str, *, keeper: str | None = None, state: RecordingState | None = None, **facts: Any
    ) -> RecordingRecord:
        """Report what became of it: facts are merged, the state only moves forward.

        ``keeper``: the recorder that reports, which has it from now on; raises TakenOver where another one
        has. So ``update(id, state="recording")`` of a recording that a user stopped meanwhile leaves it at
        ``stopping``: look at the record that comes back. Raises NotFound, BadInput.
        """
        if state is not None and state not in _ORDER:
            raise BadInput(f"{state!r} is no state of a recording; {did_you_mean(state, _ORDER)}")
        with self._database.write() as connection:
            if state is not None:
                tell_change(connection, "recording")
            return _move(connection, id, state, facts, keeper=keeper)

    def get(self, id: str) -> RecordingRecord:
        """Raises NotFound."""
        with self._database.read() as connection:
            return _require(connection, id)

    def unsettled(self) -> list[RecordingRecord]:
        """Recordings that are open, or to be repaired, newest first."""
        return self._select(tables.recordings.c.state.in_((*OPEN_RECORDING_STATES, "repairing")))

    def list(self, glove: str | None = None, *, only_open: bool = False) -> list[RecordingRecord]:
        """Recordings, newest first."""
        table = tables.recordings
        wanted = [] if glove is None else [table.c.glove == glove]
        if only_open:
            wanted.append(table.c.state.in_(OPEN_RECORDING_STATES))
        return self._select(*wanted)

    def page(
        self,
        part: ListPart,
        *,
        glove: str | None = None,
        subject: str | None = None,
        states: Sequence[RecordingState] | None = None,
    ) -> Page[RecordingRecord]:
        """A part of them, newest first."""
        table = tables.recordings.c
        with self._database.read() as connection:
            return _LISTING.page(
                connection, _record, part,
                None if glove is None else table.glove == glove,
                None if subject is None else table.subject == subject,
                None if states is None else table.state.in_(states),
            )  # fmt: skip

    def _select(self, *wanted: ColumnElement[bool]) -> list[RecordingRecord]:
        with self._database.read() as connection:
            return sound_rows(connection, tables.recordings, _LISTING.every(*wanted), _record)


def with_pre_roll(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts, or what a run's ledger says of itself, with the pre-roll under today's key."""
    return {PRE_ROLL if key == PRE_ROLL_BEFORE else key: value for key, value in facts.items()}


def _move(
    connection: Connection,
    id: str,
    state: str | None,
    facts: dict[str, Any],
    name: str | None = None,
    keeper: str | None = None,
) -> RecordingRecord:
    def change(row: dict[str, Any]) -> dict[str, Any]:
        if keeper is not None and row["facts"].setdefault(KEEPER, keeper) != keeper:
            raise TakenOver(f"recording {row['name']!r} goes on at {row['facts'][KEEPER]}")
        values: dict[str, Any] = {"facts": {**row["facts"], **facts}, "updated_at": now()}
        if state is not None and _ORDER[state] > _ORDER[row["state"]]:
            values["state"] = state
        return values if name is None else {**values, "name": name}

    change_rows(connection, tables.recordings, tables.recordings.c.id == id, change)
    return _require(connection, id)


def _open_recording(connection: Connection, glove: str) -> RecordingRecord | None:
    table = tables.recordings
    open_ones = (table.c.glove == glove) & table.c.state.in_(OPEN_RECORDING_STATES)
    row = connection.execute(select(table).where(open_ones).limit(1)).first()
    return None if row is None else _record(sound_row(table, row))


def _require(connection: Connection, id: str) -> RecordingRecord:
    row = connection.execute(select(tables.recordings).where(tables.recordings.c.id == id)).one_or_none()
    if row is None:
        raise NotFound(f"there is no recording {id!r}")
    return _record(sound_row(tables.recordings, row))


def _record(values: dict[str, Any]) -> RecordingRecord:
    return RecordingRecord(**{**values, "facts": with_pre_roll(values["facts"])})
