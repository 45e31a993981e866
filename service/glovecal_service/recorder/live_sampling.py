"""One guided sampling while it goes on: frames and time in, its state into the store."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import zenoh

from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame
from glovecal_models.layout import Layout
from glovecal_models.sampling.active.next_step import NextStep
from glovecal_models.sampling.engine import Sampling
from glovecal_models.sampling.reading import GloveReading
from glovecal_models.sampling.state import OVER, Choose, NextSteps, SamplingState
from glovecal_models.sampling.verdict import TouchCheck
from glovecal_service.incoming.arrivals import Arrivals
from glovecal_service.recorder.run_ledger import decoded
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import RecordingRecord, SamplingRecord
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
