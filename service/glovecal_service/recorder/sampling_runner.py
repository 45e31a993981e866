"""Lets the open samplings of the store go on, and stores the takes of those that are over.

While one goes on, frames and time go in and its state goes into the store.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Event
from typing import Any

import zenoh
from sqlalchemy.exc import SQLAlchemyError

from glovecal_client.errors import ClientError
from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame
from glovecal_models.errors import GlovecalError
from glovecal_models.layout import Layout
from glovecal_models.sampling.active.next_step import NextStep
from glovecal_models.sampling.engine import Sampling
from glovecal_models.sampling.guided.touch_watch import TouchWatch
from glovecal_models.sampling.sampled_takes import SampledTake, sampled_takes
from glovecal_models.sampling.state import OVER, Choose, GloveReading, NextSteps, SamplingState
from glovecal_models.sampling.verdict import TouchCheck
from glovecal_models.takes.take import Take
from glovecal_service.incoming.arrivals import Arrivals
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.plain import reason_of
from glovecal_service.recorder.run_ledger import decoded
from glovecal_service.settings import Settings
from glovecal_service.store.errors import Conflict, DamagedRows, StorageFull, StoreError, StoreUnavailable
from glovecal_service.store.records import RecordingRecord, SamplingRecord, TakeRecord
from glovecal_service.store.store import Store

LIVE_EVERY_S = 0.25
RECORDING_EVERY_S = 0.2
AGAIN_AFTER_S = 2.0
WAITING_LIMIT = 4096


class LiveSampling:
    """Listens with a subscription of its own, so that it holds up nobody.

    ``clock`` is the one of the store's documents: seconds since 1970, as the web process has it too.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: GloveKeys,
        record: SamplingRecord,
        layout: Layout,
        touch_check: TouchCheck | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.record = record
        self._clock = clock
        self._choose = BackgroundPlanner(NextStep(layout))
        state = SamplingState.from_document(record.document)
        self._sampling = Sampling(state, touch_check=touch_check, choose=self._choose)
        self._sampling.recording = None
        self._saved = self._mark()
        self._sampling.interrupted(clock())
        self._live_at = self._recording_at = 0.0
        self._live: dict[str, Any] = {}
        self._arrivals = Arrivals(session, keys.raw, limit=WAITING_LIMIT)

    @property
    def state(self) -> SamplingState:
        return self._sampling.state

    @property
    def is_over(self) -> bool:
        return self.state.phase in OVER

    def follow(self, record: SamplingRecord) -> None:
        """The record as the store has it now; the user may have changed it."""
        if record.version != self.record.version:
            self._sampling.follow(SamplingState.from_document(record.document))
            self._saved = self._mark()
        self.record = record

    def look(self, store: Store) -> None:
        """Take in what came, let time pass, store what changed. Raises what the store raises."""
        for arrival in self._arrivals.drain():
            frame = decoded(arrival.payload)
            if frame is not None:
                self._sampling.frame(self._clock(), _reading(frame))
        self._sampling.tick(self._clock())
        if self._mark() != self._saved:
            self._save(store)
        self._keep_recording(store)
        self._tell(store)

    def close(self) -> None:
        self._arrivals.close()
        self._choose.close()

    def _save(self, store: Store) -> None:
        kept = store.samplings.save(self.record, self.state.to_document())
        if kept is None:
            self.follow(store.samplings.get(self.record.id))
        else:
            self.record, self._saved = kept, self._mark()

    def _mark(self) -> tuple[Any, ...]:
        """Differs when there is something to store."""
        state = self.state
        return (state.phase, state.step, state.said_number, len(state.attempts), state.since_s)

    def _keep_recording(self, store: Store) -> None:
        """A recording goes on as long as the sampling does; a pause ends it, the next begins with its end."""
        if time.monotonic() < self._recording_at:
            return
        self._recording_at = time.monotonic() + RECORDING_EVERY_S
        ids = self.record.recordings
        newest = store.recordings.get(ids[-1]) if ids else None
        wanted = self.state.phase not in (*OVER, "paused")
        self._sampling.recording = newest.id if newest and newest.state == "recording" and wanted else None
        if wanted and (newest is None or not newest.is_open):
            self._ask_for_recording(store, newest)
        elif not wanted and newest is not None and newest.state in ("requested", "recording"):
            store.recordings.stop(newest.id)

    def _ask_for_recording(self, store: Store, last: RecordingRecord | None) -> None:
        mine = self.record
        name = f"sampling-{mine.id}-{len(mine.recordings) + 1}"
        failed = last is not None and last.state == "failed"
        try:
            asked = store.recordings.request(
                mine.glove, name=name, subject=mine.subject, wearing=mine.wearing or None
            )
        except Conflict as error:
            store.samplings.note(mine.id, problem=str(error))
            self._recording_at = time.monotonic() + AGAIN_AFTER_S
            return
        problem = last.facts.get("sentence", "") if last is not None and failed else ""
        recordings = [*mine.recordings[: -1 if failed else None], asked.id]
        store.samplings.note(mine.id, recordings=recordings, problem=problem)
        self.follow(store.samplings.get(mine.id))

    def _tell(self, store: Store) -> None:
        now = time.monotonic()
        if now - self._live_at < LIVE_EVERY_S or self.is_over:
            return
        percent = self._sampling.steadiness_percent
        live = {"steadiness_percent": None if percent is None else round(percent, 1)}
        if live != self._live:
            store.samplings.note(self.record.id, live=live)
        self._live, self._live_at = live, now


def _reading(frame: Frame) -> GloveReading:
    return GloveReading(
        frame.monotonic_ns / 1e9, frame.sequence, f"{frame.run_id:016x}", frame.readings, frame.button
    )


# Choosing the next step in a thread of its own: frames do not wait for it.


class BackgroundPlanner:
    """A ``Choose`` that answers None until ``choose`` has an answer for the state as it is."""

    def __init__(self, choose: Choose) -> None:
        self._choose = choose
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="next-step")
        self._asked: tuple[Any, ...] | None = None
        self._answer: Future[NextSteps | None] | None = None

    def __call__(self, state: SamplingState) -> NextSteps | None:
        """Raises what ``choose`` raises."""
        asked = _mark(state)
        if self._answer is None or asked != self._asked:
            copy = SamplingState.from_document(state.to_document())
            self._asked, self._answer = asked, self._worker.submit(self._choose, copy)
        return self._answer.result() if self._answer.done() else None

    def close(self) -> None:
        self._worker.shutdown(wait=False, cancel_futures=True)


def _mark(state: SamplingState) -> tuple[Any, ...]:
    """Differs when the answer may."""
    return (len(state.protocol.steps), *((each.step, each.counts) for each in state.attempts))


LOOK_EVERY_S = 0.04
FOLLOW_EVERY_S = 0.1
AFTER_TROUBLE_S = 1.0

_log = logging.getLogger("glovecal.sampling")


class SamplingRunner:
    """One thread for all samplings, beside the recorder's: it may stand still, the frames are written."""

    def __init__(
        self,
        session: zenoh.Session,
        settings: Settings,
        open_store: Callable[[], Store],
        owners: GloveOwners,
    ) -> None:
        self._session = session
        self._site = settings.site
        self._open_store = open_store
        self._store: Store | None = None
        self._revision: int | None = None
        self._follow_at = 0.0
        self._live: dict[str, LiveSampling] = {}
        self._owners, self._owners_version = owners, -1

    def run(self, stopped: Event) -> None:
        """Until ``stopped``; what goes on is left for the next process."""
        while not stopped.wait(LOOK_EVERY_S):
            self.look()
        for live in self._live.values():
            live.close()
        if self._store is not None:
            self._store.close()

    def look(self) -> None:
        """One round. Nothing here raises."""
        try:
            store = self._store = self._store or self._open_store()
            if time.monotonic() >= self._follow_at:
                self._follow_at = time.monotonic() + FOLLOW_EVERY_S
                self._follow(store)
            for live in list(self._live.values()):
                self._go_on(store, live)
        except (StoreError, SQLAlchemyError, OSError) as error:
            _log.warning("the store does not answer, samplings wait: %s", error)
            self._revision, self._follow_at = None, time.monotonic() + AFTER_TROUBLE_S

    def _follow(self, store: Store) -> None:
        changes = store.changes_since(self._revision)
        if not changes.are_of("sampling") and self._owners.version == self._owners_version:
            self._revision = changes.revision
            return
        self._owners_version = self._owners.version
        records = {record.id: record for record in _open_samplings(store) if self._is_mine(record)}
        for id in [id for id in self._live if id not in records]:
            self._live.pop(id).close()
        for id, record in records.items():
            try:
                if id in self._live:
                    self._live[id].follow(record)
                else:
                    keys = GloveKeys(self._site, record.glove)
                    layout = store.layouts.get(record.layout)
                    watch = _touch_watch(store, record, layout)
                    self._live[id] = LiveSampling(self._session, keys, record, layout, watch)
            except (GlovecalError, ClientError, KeyError, TypeError, ValueError) as error:
                self._give_up(store, record, f"the sampling cannot go on: {reason_of(error)}")
        self._revision = changes.revision

    def _is_mine(self, record: SamplingRecord) -> bool:
        """Whether this process is to go on with it, and has its glove from then on."""
        if not self._owners.may_begin(record.glove):
            return False
        self._owners.take(record.glove)
        return self._owners.has(record.glove)

    def _go_on(self, store: Store, live: LiveSampling) -> None:
        try:
            live.look(store)
            if live.is_over and self._recordings_are_done(store, live.record):
                self._finish(store, live)
        except (StoreUnavailable, StorageFull, SQLAlchemyError, OSError):
            raise
        except (GlovecalError, ClientError) as error:
            self._give_up(store, live.record, str(error))
        except Exception as error:  # one sampling that fails must end neither the others nor this thread
            _log.exception("sampling %s fails", live.record.id)
            what = f"an error in Glovecal itself ({type(error).__name__}): the service's log tells where"
            self._give_up(store, live.record, what)

    def _recordings_are_done(self, store: Store, record: SamplingRecord) -> bool:
        """What waits for repair is used as it is, if there is anything."""
        recordings = [store.recordings.get(id) for id in record.recordings]
        return not any(
            item.is_open or (item.state == "repairing" and "take" not in item.facts) for item in recordings
        )

    def _finish(self, store: Store, live: LiveSampling) -> None:
        takes, missing = keep_sampled_takes(store, live.record)
        store.samplings.note(live.record.id, takes=takes, problem=missing, open=False, live={})
        self._live.pop(live.record.id).close()
        _log.info("sampling %s is over: %d takes", live.record.id, len(takes))

    def _give_up(self, store: Store, record: SamplingRecord, problem: str) -> None:
        _log.warning("sampling %s: %s", record.id, problem)
        live = self._live.pop(record.id, None)
        if live is not None:
            live.close()
        store.samplings.note(record.id, problem=problem, open=False)


def _open_samplings(store: Store) -> list[SamplingRecord]:
    try:
        return store.samplings.list(only_open=True)
    except DamagedRows as error:
        _log.warning("samplings that cannot go on: %s", "; ".join(error.damaged))
        return error.sound


def _touch_watch(store: Store, record: SamplingRecord, layout: Layout) -> TouchWatch | None:
    """None where nobody measured the subject's hand: then no touch can be judged."""
    subject = store.subjects.get(record.subject)
    return TouchWatch(layout, subject.skeleton()) if subject.dimensions else None


# What a finished sampling leaves behind: takes with known angles, cut out of its recordings.


SOURCE = "sampling"


def keep_sampled_takes(store: Store, record: SamplingRecord) -> tuple[list[str], str]:
    """Ids of the takes, stored once each, and a sentence on what is not in them ("" if nothing is missing).

    Raises what the store raises; done again after that, it goes on where it was.
    """
    state = SamplingState.from_document(record.document)
    recordings = {id: store.recordings.get(id) for id in record.recordings}
    wholes = {
        id: store.takes.get(recording.facts["take"])
        for id, recording in recordings.items()
        if "take" in recording.facts
    }
    recorded: dict[str, Take] = {id: store.takes.load(whole.id) for id, whole in wholes.items()}
    found = [take for take in sampled_takes(state, recorded, name=record.id) if take.kind != "range"]
    before = {take.name: take.id for take in store.takes.list(record.subject) if _is_of(take, record.id)}
    kept = []
    for each in found:
        name = each.take.name
        kept.append(before.get(name) or _keep(store, record, each, wholes[each.recording]))
    return kept, _what_is_missing(state, found)


def _is_of(take: TakeRecord, sampling: str) -> bool:
    return ((take.accounting or {}).get(SOURCE) or {}).get("id") == sampling


def _keep(store: Store, record: SamplingRecord, each: SampledTake, whole: TakeRecord) -> str:
    clock = {"wall_minus_time_s": (whole.accounting or {}).get("wall_minus_time_s", 0.0)}
    told = {"id": record.id, "recording": each.recording, **each.to_document()}
    accounting = {**clock, "begins_s": each.begins_s, SOURCE: told}
    kept = store.takes.add(
        each.take, subject=record.subject, layout=record.layout, source=SOURCE, accounting=accounting
    )
    return kept.id


def _what_is_missing(state: SamplingState, found: list[SampledTake]) -> str:
    there = {step.name for each in found for step in each.steps}
    lost = [
        name
        for name, attempt in state.finished().items()
        if attempt.outcome == "good" and name not in there and state.protocol.step(name).kind != "range"
    ]
    return f"{', '.join(lost)}: recorded, but the frames are not in the recording." if lost else ""
