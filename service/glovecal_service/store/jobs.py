"""Jobs: long work as database rows. The rows are the only memory; whoever runs a job can be killed.

A runner claims a job by compare-and-set, which raises its attempt number and starts a lease. Everything it
writes afterwards carries the attempt number and is refused once another attempt has begun. A lease that
runs out puts the job back into the queue; after three such losses it has failed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from functools import partial
from typing import Any

from sqlalchemy import Connection, delete, exists, func, insert, select

from glovecal_models.names import check_identifier
from glovecal_service.store import tables
from glovecal_service.store.database import Database, new_id, now
from glovecal_service.store.errors import Conflict, NotFound, StoreDamaged
from glovecal_service.store.list_part import WHOLE, Listing, ListPart, Page
from glovecal_service.store.records import FINISHED_JOB_STATES, JobEvent, JobRecord, JobState
from glovecal_service.store.row_hash import add_row, change_rows, sort_out, sound_row, sound_rows

LEASE_S = 30.0
MOST_LOSSES = 3
MOST_FORGOTTEN = 1000
"""Jobs that are removed at once."""
LONGEST_SENTENCE = 2000
LONGEST_TRACEBACK = 8000
"""Characters; the innermost calls stand at its end."""
_HIDDEN = ("lease_until", "losses")
_LISTING = Listing(
    tables.jobs,
    newest_first=True,
    searched=("^id", "kind", "subject", "state", "error", "^payload.model", "payload.effect"),
)
UNFINISHED_JOB_STATES: tuple[JobState, ...] = ("queued", "running")


class Jobs:
    def __init__(self, database: Database, clock: Callable[[], float] = time.time) -> None:
        self._database = database
        self._clock = clock
        self._turns: dict[str | None, int] = {}
        """When each subject was served last; forgotten with the process, which costs one round at most."""

    def create(self, kind: str, payload: Mapping[str, Any], *, subject: str | None = None) -> JobRecord:
        """Put a job into the queue. Raises BadInput (kind, or a payload that is not JSON)."""
        id, at = new_id(), now()
        values = {
            "id": id,
            "kind": check_identifier(kind, "kind of job"),
            "subject": subject,
            "payload": dict(payload),
            "state": "queued",
            "attempt": 0,
            "losses": 0,
            "cancel_requested": False,
            "fraction": 0.0,
            "sentence": "waiting for its turn",
            "detail": {},
            "created_at": at,
            "updated_at": at,
        }
        with self._database.write() as connection:
            add_row(connection, tables.jobs, values)
            return _noted(connection, id)

    def claim(self, owner: str) -> JobRecord | None:
        """Take a queued job, None if there is none: the oldest of the subject that has waited longest for its
        turn, so that nobody waits behind another's hundreds. Jobs whose lease ran out are queued first."""
        table = tables.jobs
        with self._database.read() as connection:
            waiting = (table.c.state == "queued") | (
                (table.c.state == "running") & (table.c.lease_until < self._clock())
            )
            if connection.execute(select(table.c.id).where(waiting).limit(1)).first() is None:
                return None
        with self._database.write() as connection:
            self._requeue(connection, table.c.lease_until < self._clock())
            queued = table.c.state == "queued"
            waiting = select(table.c.id, table.c.subject).where(queued)
            rows = connection.execute(waiting.order_by(table.c.created_at, table.c.id)).all()
            for id, subject in sorted(rows, key=lambda row: self._turns.get(row.subject, 0)):
                mine = (table.c.id == id) & queued
                with suppress(StoreDamaged):  # the job stays where it is, and lists name it
                    if change_rows(connection, table, mine, partial(self._claimed, owner), skip_locked=True):
                        self._turns[subject] = 1 + max(self._turns.values(), default=0)
                        return _noted(connection, id)
        return None

    def _claimed(self, owner: str, row: Mapping[str, Any]) -> dict[str, Any]:
        at = now()
        return {
            "state": "running",
            "attempt": row["attempt"] + 1,
            "owner": owner,
            "lease_until": self._clock() + LEASE_S,
            "sentence": "starting",
            "started_at": at,
            "updated_at": at,
        }

    def heartbeat(self, id: str, attempt: int) -> JobRecord:
        """Extend the lease; the record says whether to cancel. Raises Conflict if the attempt is over."""
        with self._database.write() as connection:
            self._write(connection, id, attempt, {"lease_until": self._clock() + LEASE_S})
            return _require(connection, id)

    def progress(
        self,
        id: str,
        attempt: int,
        fraction: float,
        sentence: str,
        detail: Mapping[str, Any] | None = None,
    ) -> JobRecord:
        """Say how far the job is (0..1) and what happened. Raises Conflict if the attempt is over."""
        values: dict[str, Any] = {
            "fraction": min(max(float(fraction), 0.0), 1.0),
            "sentence": _plain(sentence),
            "lease_until": self._clock() + LEASE_S,
            "detail": dict(detail or {}),
        }
        with self._database.write() as connection:
            self._write(connection, id, attempt, values)
            return _noted(connection, id)

    def finish(self, id: str, attempt: int, result: Mapping[str, Any]) -> JobRecord:
        """The job is done. Raises Conflict if the attempt is over."""
        return self._end(id, attempt, "done", "done", result=dict(result), fraction=1.0)

    def fail(self, id: str, attempt: int, error: str, traceback: str | None = None) -> JobRecord:
        """The job cannot be done; ``error`` is a sentence for the user. Raises Conflict.

        ``traceback``: of an error that nobody foresaw; its last 8,000 characters are kept.
        """
        kept = None if traceback is None else _plain_text(traceback)[-LONGEST_TRACEBACK:]
        return self._end(id, attempt, "failed", error, error=_plain(error), traceback=kept)

    def cancelled(self, id: str, attempt: int) -> JobRecord:
        """The job was stopped as requested. Raises Conflict if the attempt is over."""
        return self._end(id, attempt, "cancelled", "cancelled")

    def release(self, id: str, attempt: int) -> JobRecord:
        """Give an unfinished job back, as a service does that stops; that is no loss.

        One that was to be cancelled is cancelled. Raises Conflict if the attempt is over.
        """
        table = tables.jobs
        values = {"state": "queued", "owner": None, "sentence": "waiting for the service to start again"}
        with self._database.write() as connection:
            self._write(connection, id, attempt, {**values, "lease_until": None})
            if _require(connection, id).cancel_requested:
                change_rows(connection, table, table.c.id == id, _cancelled())
            return _noted(connection, id)

    def request_cancel(self, id: str) -> JobRecord:
        """Ask for the end of a job: a queued one is cancelled at once, a running one by its runner.

        A finished job stays as it is. Raises NotFound.
        """
        table, at = tables.jobs, now()
        with self._database.write() as connection:
            asked = {"cancel_requested": True, "updated_at": at}
            queued = (table.c.id == id) & (table.c.state == "queued")
            if change_rows(connection, table, queued, {**_cancelled(), **asked}):
                return _noted(connection, id)
            running = (table.c.id == id) & (table.c.state == "running")
            change_rows(connection, table, running, asked)
            return _require(connection, id)

    def requeue_of(self, owner: str) -> int:
        """Put the running jobs of an owner that is known to be dead back; how many there were."""
        with self._database.write() as connection:
            return self._requeue(connection, tables.jobs.c.owner == owner)

    def owners(self) -> set[str]:
        """Owners of the running jobs."""
        statement = select(tables.jobs.c.owner).where(tables.jobs.c.state == "running").distinct()
        with self._database.read() as connection:
            return {owner for owner in connection.scalars(statement) if owner is not None}

    def get(self, id: str) -> JobRecord:
        """Raises NotFound."""
        with self._database.read() as connection:
            return _require(connection, id)

    def events(self, id: str, after: int = 0) -> list[JobEvent]:
        """What happened in a job after the event with that number. Raises NotFound."""
        table = tables.job_events
        statement = select(table).where((table.c.job == id) & (table.c.id > after)).order_by(table.c.id)
        with self._database.read() as connection:
            _require(connection, id)
            return sound_rows(connection, table, statement, lambda values: JobEvent(**values))

    def forget_steps(self, before: datetime) -> int:
        """Remove what happened in jobs that were over before that time, but not the jobs; how many steps."""
        jobs, steps = tables.jobs.c, tables.job_events
        over = select(jobs.id).where(jobs.state.in_(FINISHED_JOB_STATES) & (jobs.finished_at < before))
        with self._database.write() as connection:
            return connection.execute(delete(steps).where(steps.c.job.in_(over))).rowcount

    def forget(self, before: datetime) -> int:
        """Remove jobs with their results that were over before that time, where a later one of their kind and
        subject was done; how many. A damaged one stays, and is named."""
        table, later = tables.jobs, tables.jobs.alias("later")
        is_followed = exists().where(
            later.c.subject.is_not_distinct_from(table.c.subject),
            later.c.kind == table.c.kind,
            later.c.state == "done",
            later.c.finished_at > table.c.finished_at,
        )
        over = table.c.state.in_(FINISHED_JOB_STATES) & (table.c.finished_at < before)
        statement = select(table).where(over, is_followed).order_by(table.c.finished_at).limit(MOST_FORGOTTEN)
        with self._database.write() as connection:
            jobs, _ = sort_out(table, connection.execute(statement), _record)
            ids = [job.id for job in jobs]
            connection.execute(delete(tables.job_events).where(tables.job_events.c.job.in_(ids)))
            connection.execute(delete(table).where(table.c.id.in_(ids)))
        return len(ids)

    def list(
        self, *, subject: str | None = None, only_unfinished: bool = False, part: ListPart = WHOLE
    ) -> list[JobRecord]:
        """Jobs, newest first."""
        table = tables.jobs.c
        chosen = _LISTING.every(
            None if subject is None else table.subject == subject,
            table.state.not_in(FINISHED_JOB_STATES) if only_unfinished else None,
            part=part,
        )
        with self._database.read() as connection:
            return sound_rows(connection, tables.jobs, chosen, _record)

    def page(
        self,
        part: ListPart,
        *,
        subject: str | None = None,
        states: Sequence[JobState] | None = None,
        kind: str | None = None,
    ) -> Page[JobRecord]:
        """A part of them, newest first."""
        table = tables.jobs.c
        with self._database.read() as connection:
            return _LISTING.page(
                connection, _record, part,
                None if subject is None else table.subject == subject,
                None if states is None else table.state.in_(states),
                None if kind is None else table.kind == kind,
            )  # fmt: skip

    def unfinished(self) -> dict[str, int]:
        """How many jobs are in each state that is not final."""
        state = tables.jobs.c.state
        statement = select(state, func.count()).where(state.in_(UNFINISHED_JOB_STATES)).group_by(state)
        with self._database.read() as connection:
            return {row[0]: row[1] for row in connection.execute(statement)}

    def _end(self, id: str, attempt: int, state: str, sentence: str, **values: Any) -> JobRecord:
        at: datetime = now()
        ended = {
            "state": state,
            "sentence": _plain(sentence),
            "finished_at": at,
            "lease_until": None,
        }
        with self._database.write() as connection:
            self._write(connection, id, attempt, {**ended, **values})
            return _noted(connection, id)

    def _write(self, connection: Connection, id: str, attempt: int, values: Mapping[str, Any]) -> None:
        table = tables.jobs
        mine = (table.c.id == id) & (table.c.attempt == attempt) & (table.c.state == "running")
        if not change_rows(connection, table, mine, {**values, "updated_at": now()}):
            record = _require(connection, id)
            raise Conflict(
                f"attempt {attempt} of job {id} is over: it is {record.state} in attempt {record.attempt}"
            )

    def _requeue(self, connection: Connection, condition: Any) -> int:
        table = tables.jobs
        ids = connection.scalars(select(table.c.id).where((table.c.state == "running") & condition))
        requeued = 0
        for id in ids.all():
            mine = (table.c.id == id) & (table.c.state == "running") & condition
            with suppress(StoreDamaged):  # the job stays where it is, and lists name it
                if change_rows(connection, table, mine, _after_loss, skip_locked=True):
                    _noted(connection, id)
                    requeued += 1
        return requeued


def _plain(sentence: str) -> str:
    """Text that both databases can keep, whatever an exception's message holds."""
    return _plain_text(sentence)[:LONGEST_SENTENCE]


def _plain_text(text: str) -> str:
    return text.encode("utf-8", "replace").decode().replace("\0", "")


def _after_loss(row: Mapping[str, Any]) -> dict[str, Any]:
    """What becomes of a running job whose runner died."""
    at = now()
    if row["cancel_requested"]:
        return {**_cancelled(), "updated_at": at}
    losses = row["losses"] + 1
    if losses >= MOST_LOSSES:
        sentence = f"given up: the process that ran it died {losses} times"
        return {
            "state": "failed",
            "losses": losses,
            "sentence": sentence,
            "error": sentence,
            "finished_at": at,
            "updated_at": at,
            "lease_until": None,
        }
    return {
        "state": "queued",
        "updated_at": at,
        "losses": losses,
        "owner": None,
        "lease_until": None,
        "sentence": "waiting again: the process that ran it died",
    }


def _cancelled() -> dict[str, Any]:
    return {"state": "cancelled", "sentence": "cancelled", "finished_at": now(), "lease_until": None}


def _noted(connection: Connection, id: str) -> JobRecord:
    """The job's record, with its present step kept as an event."""
    record = _require(connection, id)
    step = {name: getattr(record, name) for name in ("attempt", "state", "fraction", "sentence", "detail")}
    connection.execute(insert(tables.job_events).values(job=id, created_at=record.updated_at, **step))
    return record


def _require(connection: Connection, id: str) -> JobRecord:
    row = connection.execute(select(tables.jobs).where(tables.jobs.c.id == id)).one_or_none()
    if row is None:
        raise NotFound(f"there is no job {id!r}. List them: glovecal job list")
    return _record(sound_row(tables.jobs, row))


def _record(values: Mapping[str, Any]) -> JobRecord:
    return JobRecord(**{name: value for name, value in values.items() if name not in _HIDDEN})
