"""The recorder process: carries out the recordings that the store asks for, through restarts and full disks.

Its disk, its database and its Python never make a pose wait.
"""

from __future__ import annotations

import hashlib
import logging
import math
import secrets
import socket
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import Any

import zenoh
from sqlalchemy.exc import SQLAlchemyError

from glovecal_client.clock import wall_ns
from glovecal_client.errors import ClientError, NoAnswer
from glovecal_client.keys import GloveKeys
from glovecal_client.session import ask_json, open_client
from glovecal_models.errors import BadInput, GlovecalError
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.logs import Word
from glovecal_service.plain import reason_of
from glovecal_service.recorder.live_recording import LiveRecording
from glovecal_service.recorder.log_comparison import reconcile_and_compare
from glovecal_service.recorder.pre_roll import pre_roll_request
from glovecal_service.recorder.reconciliation import CaptureLog, Patience
from glovecal_service.recorder.recording_result import Settlement, keep_as_take
from glovecal_service.recorder.run_ledger import BEGIN, CAPTURE, CREATED, FINDINGS, SUFFIX, RunLedger
from glovecal_service.recorder.sampling_runner import SamplingRunner
from glovecal_service.settings import Settings
from glovecal_service.store.database import now
from glovecal_service.store.errors import (
    Conflict,
    DamagedRows,
    StorageFull,
    StoreDamaged,
    StoreError,
    StoreUnavailable,
    TakenOver,
)
from glovecal_service.store.recordings import ENDED_BY, KEEPER, PRE_ROLL, STOP_ASKED
from glovecal_service.store.records import RecordingRecord
from glovecal_service.store.store import Store

LOOK_EVERY_S = 0.05
REPORT_EVERY_S = 1.0
RESUME_WITHIN_S = 60.0
"""A recording interrupted for longer is finished as it is: nobody meant the hours in between."""
GIVE_UP_AFTER_S = 7 * 86400.0
"""What no capture log gave until then is missing."""
FINISH_WITHIN_S = 5.0
"""For the account and the pre-roll; ten minutes of it at 120 Hz come in about as long."""
NOTICED_AFTER_S = 2 * LOOK_EVERY_S
"""A recorder that runs sees a stop by then, and so long one that did not run would have recorded."""
TAKE_OVER_AFTER_S = 10.0
"""Of what a recorder elsewhere began: one that died is back sooner, and has the file. What it only repairs
stays with it: the frames are there and perhaps nowhere else."""
MOST_AT_ONCE = 32

_log = logging.getLogger("glovecal.recorder")


@dataclass(frozen=True)
class Pause:
    """Between two attempts to repair a recording: 1 s at first, at most 10 s."""

    seconds: float = 0.5
    until: float = 0.0

    @property
    def is_over(self) -> bool:
        return time.monotonic() >= self.until

    def longer(self) -> Pause:
        seconds = min(2 * self.seconds, 10.0)
        return Pause(seconds, time.monotonic() + seconds)


class Recorder:
    """One thread for all recordings. ``look`` does a round of work; call it again and again."""

    def __init__(
        self,
        session: zenoh.Session,
        settings: Settings,
        open_store: Callable[[], Store],
        owners: GloveOwners,
    ) -> None:
        self._owners = owners
        self._keeper = _keeper(settings)
        self._place = _place(settings)
        self._session = session
        self._settings = settings
        self._open_store = open_store
        self._store: Store | None = None
        self._revision: int | None = None
        self._owners_version = -1
        self._away_since: dict[str, float] = {}
        """By recordings of others: since when nobody has the glove."""
        self._others_at = math.inf
        """When to look again whether what another recorder has is still reported on."""
        self._looked_at = 0.0
        self._reported_at = 0.0
        self._live: dict[str, LiveRecording] = {}
        self._settling: dict[str, Future[Settlement | None]] = {}
        """Recordings that are over: their account is made, or repaired, each in a thread of its own."""
        self._pauses: dict[str, Pause] = {}
        """Until the next attempt to repair a recording."""
        self._threads = ThreadPoolExecutor(MOST_AT_ONCE, thread_name_prefix="recording")
        self._stopping = Event()

    def run(self, stopped: Event) -> None:
        """Until ``stopped``; recordings that go on are left for the next process to resume."""
        while not stopped.wait(LOOK_EVERY_S):
            self.look()
        self._stopping.set()
        for live in self._live.values():
            live.abandon()
        self._threads.shutdown(cancel_futures=True)
        if self._store is not None:
            self._store.close()

    def look(self) -> None:
        """Follow the store, write what arrived, repair gaps, report. Nothing here raises.

        The store first: after this process stood still, it says where a recording ended meanwhile.
        """
        now = time.monotonic()
        if now - self._looked_at >= 2 * LOOK_EVERY_S:
            self._looked_at = now
            self._with_store(self._follow)
        for id, live in list(self._live.items()):
            try:
                live.take_in()
                live.take_pre_roll()
                live.repair_now_and_then()
            except (ClientError, OSError, ValueError) as error:
                self._note(id, sentence=f"recording goes on with trouble: {reason_of(error)}")
        if now - self._reported_at >= REPORT_EVERY_S:
            self._reported_at = now
            self._with_store(self._report)

    def _with_store(self, work: Callable[[Store], None]) -> None:
        try:
            work(self._opened())
        except (StoreError, SQLAlchemyError, OSError) as error:
            _log.warning("the store does not answer, recordings go on: %s", error)
            self._looked_at = time.monotonic() + REPORT_EVERY_S

    def _opened(self) -> Store:
        if self._store is None:
            self._store = self._open_store()
        return self._store

    def _follow(self, store: Store) -> None:
        changes = store.changes_since(self._revision)
        if changes.are_of("recording") or self._is_anything_due():
            self._owners_version = self._owners.version
            records = _sound(store.recordings.unsettled)
            mine = [record for record in records if self._is_mine(record)]
            self._away_since = {
                each.id: self._away_since[each.id] for each in records if each.id in self._away_since
            }
            self._others_at = math.inf if len(mine) == len(records) else time.monotonic() + REPORT_EVERY_S
            settled = [self._move(store, record) for record in mine]
            self._revision = changes.revision if all(settled) else None
        else:
            self._revision = changes.revision

    def _is_mine(self, record: RecordingRecord) -> bool:
        """Whether this recorder is to go on with it, and has its glove from then on."""
        glove, keeper = record.glove, record.facts.get(KEEPER)
        if record.id in {*self._live, *self._settling, *self._pauses}:
            if not self._owners.has(glove):
                self._let_go(record.id, "another recorder has its glove")
            return self._owners.has(glove)
        if keeper in (None, self._keeper):
            is_mine = self._owners.may_begin(glove, among="" if keeper is None else self._place)
        else:
            is_mine = self._is_abandoned(record) and self._owners.may_begin(glove)
        if is_mine:
            self._owners.take(glove)
        return is_mine

    def _is_abandoned(self, record: RecordingRecord) -> bool:
        """Whether the recorder that began it has been away for long."""
        is_there = record.state == "repairing" or self._owners.is_elsewhere(record.glove)
        since = self._away_since.setdefault(record.id, time.monotonic())
        if is_there or (now() - record.updated_at).total_seconds() < TAKE_OVER_AFTER_S:
            self._away_since[record.id] = time.monotonic()
            return False
        return time.monotonic() - since > TAKE_OVER_AFTER_S

    def _let_go(self, id: str, why: str) -> None:
        """What was written of it stays in its file."""
        _log.warning("recording %s is let go: %s", id, why)
        live = self._live.pop(id, None)
        if live is not None:
            live.abandon()
        self._settling.pop(id, None)
        self._pauses.pop(id, None)

    def _is_anything_due(self) -> bool:
        if self._owners.version != self._owners_version or time.monotonic() >= self._others_at:
            return True
        return any(future.done() for future in self._settling.values()) or any(
            pause.is_over and id not in self._settling for id, pause in self._pauses.items()
        )

    def _move(self, store: Store, record: RecordingRecord) -> bool:
        """Bring a recording one state on; False if that has to be tried again."""
        try:
            if record.id in self._settling:
                self._finish(store, record)
            elif record.state == "repairing":
                self._repair(record)
            elif record.id not in self._live:
                self._begin(store, record)
            elif record.state == "stopping":
                self._end(record)
        except (StoreUnavailable, SQLAlchemyError):
            raise
        except TakenOver as error:
            self._let_go(record.id, str(error))
        except StorageFull as error:
            self._note(record.id, sentence=f"goes on as soon as there is room: {error}")
            self._looked_at = time.monotonic() + REPORT_EVERY_S
            return False
        except (GlovecalError, ClientError, OSError, ValueError) as error:
            self._fail(store, record, reason_of(error))
        return True

    def _begin(self, store: Store, record: RecordingRecord) -> None:
        """Record from now on, or go on with the file of a recorder that was killed, or end that."""
        path = self._path(record)
        if record.facts.get(KEEPER) not in (None, self._keeper):
            _log.warning("recording %s goes on here: %s is silent", record.name, record.facts[KEEPER])
            record = store.recordings.take_over(record, self._keeper)
            if record.state == "stopping" and not path.exists():
                self._create(store, record, path).close()
        interrupted = path.exists()
        if record.state == "stopping" and not interrupted:
            raise BadInput(f"recording {record.name} was stopped before it began: nothing was recorded")
        silent_s = (now() - record.updated_at).total_seconds()
        if record.state == "recording" and silent_s > RESUME_WITHIN_S:
            note = f"ended with its last frame: no recorder was running for {silent_s:.0f} s"
            record = self._update(store, record.id, state="stopping", **{ENDED_BY: note})
        if record.state == "stopping":
            self._settling[record.id] = self._threads.submit(
                settle,
                path,
                CaptureLog(self._session, self._keys(record)),
                _stop_wall_ns(record, NOTICED_AFTER_S),
                account=record.facts,
                patience=Patience(FINISH_WITHIN_S, self._stopping),
            )
            return

        def file() -> RunLedger:
            known = record.facts.get(FINDINGS)
            return RunLedger.resume(path, known) if interrupted else self._create(store, record, path)

        live = self._live[record.id] = LiveRecording(self._session, self._keys(record), file)
        facts: dict[str, Any] = {} if BEGIN not in live.file.meta else {BEGIN: live.file.meta[BEGIN]}
        if interrupted:
            facts["interruptions"] = [*record.facts.get("interruptions", []), _interruption(live.file)]
        what = Word("resumed" if interrupted else "began")
        _log.info("recording %s of glove %s %s", record.name, record.glove, what)
        self._update(store, record.id, state="recording", sentence="recording", **facts)

    def _update(self, store: Store, id: str, **changes: Any) -> RecordingRecord:
        """Raises TakenOver where another recorder has it now."""
        return store.recordings.update(id, keeper=self._keeper, **changes)

    def _keys(self, record: RecordingRecord) -> GloveKeys:
        return GloveKeys(self._settings.site, record.glove)

    def _path(self, record: RecordingRecord) -> Path:
        return self._settings.recordings_folder / f"{record.id}{SUFFIX}"

    def _create(self, store: Store, record: RecordingRecord, path: Path) -> RunLedger:
        keys = self._keys(record)
        meta: dict[str, Any] = {"recording": record.id, "name": record.name, "glove": record.glove}
        meta[CREATED] = wall_ns()
        if began := _begin_elsewhere(record):
            meta[BEGIN] = began
        try:
            meta[CAPTURE] = ask_json(self._session, keys.meta, timeout_s=5.0)
            standing = CaptureLog(self._session, keys).standing()
            now_there = {
                "run_id": f"{standing.runs[-1].run_id:016x}",
                "sequence": standing.sequence,
                "wall_ns": wall_ns() + standing.clock_ahead_ns,
                "clock_ahead_ns": standing.clock_ahead_ns,
            }
            meta.setdefault(BEGIN, now_there)
        except NoAnswer:
            _log.info("recording %s of glove %s begins with its first frame", record.name, record.glove)
        others = _sound(lambda: store.recordings.list(record.glove))
        meta[PRE_ROLL] = pre_roll_request(record, store.gloves.get(record.glove), others, now()).document()
        try:
            return RunLedger.create(path, meta)
        except OSError as error:
            raise StorageFull(
                f"recording {record.name}: {path.name} cannot be written: {reason_of(error)}"
            ) from error

    def _end(self, record: RecordingRecord) -> None:
        live = self._live.pop(record.id)
        self._settling[record.id] = self._threads.submit(
            live.finish, _stop_wall_ns(record), Patience(FINISH_WITHIN_S, self._stopping)
        )

    def _repair(self, record: RecordingRecord) -> None:
        """Try again when it is time; a recorder that was just started tries at once."""
        pause = self._pauses.get(record.id)
        if pause is None or pause.is_over:
            self._settling[record.id] = self._threads.submit(
                repair,
                self._path(record),
                CaptureLog(self._session, self._keys(record)),
                _stop_wall_ns(record, NOTICED_AFTER_S),
                account=record.facts,
                stopped=self._stopping,
                last_try=(now() - record.requested_at).total_seconds() > GIVE_UP_AFTER_S,
            )

    def _finish(self, store: Store, record: RecordingRecord) -> None:
        """Store what the thread came to, once it is through."""
        future = self._settling[record.id]
        if not future.done():
            return
        try:
            settlement = future.result()
        except OSError as error:
            if record.state != "repairing":
                raise
            _log.warning("recording %s cannot be repaired now: %s", record.name, error)
            settlement = None
        if settlement is not None and not self._keep(store, record, settlement):
            return
        del self._settling[record.id]
        if settlement is None or not settlement.is_final:
            self._pauses[record.id] = self._pauses.get(record.id, Pause()).longer()
        else:
            self._pauses.pop(record.id, None)

    def _keep(self, store: Store, record: RecordingRecord, settlement: Settlement) -> bool:
        """Store account and take; False if a user changed the take at this very moment: then once more."""
        record = self._update(store, record.id, **settlement.account)
        try:
            facts = keep_as_take(store, record, settlement, self._settings.recordings_folder)
        except TakenOver:
            raise
        except Conflict:
            if "take" in record.facts:
                return False
            raise
        if facts["sentence"] != record.facts.get("sentence"):
            _log.info("recording %s: %s", record.name, facts["sentence"])
        state = "done" if settlement.is_final else "repairing"
        self._update(store, record.id, state=state, **facts)
        return True

    def _fail(self, store: Store, record: RecordingRecord, problem: str) -> None:
        _log.warning("recording %s failed: %s", record.name, problem)
        live = self._live.pop(record.id, None)
        if live is not None:
            live.abandon()
        self._settling.pop(record.id, None)
        self._pauses.pop(record.id, None)
        account = {} if live is None else live.account()
        try:
            self._update(store, record.id, state="failed", sentence=problem, **account)
        except TakenOver as error:
            _log.warning("recording %s failed here: %s", record.name, error)

    def _report(self, store: Store) -> None:
        for id, live in list(self._live.items()):
            live.file.sync()
            problem = live.file.problem
            sentence = f"frames wait in memory: {problem}" if problem else "recording"
            try:
                self._update(store, id, sentence=sentence, **live.account())
            except TakenOver as error:
                self._let_go(id, str(error))
            except StoreDamaged as error:  # its frames are written all the same, the others are reported
                _log.warning("recording %s cannot be reported: %s", id, error)

    def _note(self, id: str, **facts: Any) -> None:
        _log.warning("recording %s: %s", id, facts)
        try:
            self._update(self._opened(), id, **facts)
        except (StoreError, SQLAlchemyError, OSError):
            return


def _sound(recordings: Callable[[], list[RecordingRecord]]) -> list[RecordingRecord]:
    """Those that can be read; the others are logged."""
    try:
        return recordings()
    except DamagedRows as error:
        _log.warning("recordings that cannot be read: %s", "; ".join(error.damaged))
        return error.sound


def _keeper(settings: Settings) -> str:
    """Computer and folder, as ``KEEPER`` has them."""
    return f"{socket.gethostname()}:{settings.recordings_folder.resolve()}"


def _place(settings: Settings) -> str:
    """What the names of all recorders of a data folder begin with."""
    return f"recorder-{hashlib.sha256(_keeper(settings).encode()).hexdigest()[:8]}-"


def _begin_elsewhere(record: RecordingRecord) -> dict[str, Any] | None:
    """For the header: where it began, of a recording that another recorder began; None for a new one."""
    if BEGIN in record.facts or not record.facts.get("runs"):
        return record.facts.get(BEGIN)
    first = record.facts["runs"][0]
    return {
        "run_id": first["run_id"],
        "sequence": first["first_sequence"] - 1,
        "wall_ns": round(record.requested_at.timestamp() * 1e9),
        "clock_ahead_ns": 0,
    }


def _interruption(file: RunLedger) -> dict[str, Any]:
    return {"last_frame_wall_s": file.last_wall_ns / 1e9, "resumed_wall_s": time.time()}


def _stop_wall_ns(record: RecordingRecord, later_s: float = 0.0) -> int | None:
    """When its end was asked for, ``later_s`` added; None: nobody asked for it."""
    asked_s = record.facts.get(STOP_ASKED)
    return None if asked_s is None else round((asked_s + later_s) * 1e9)


# Repairing a recording whose file is closed, from the capture log.


REPAIR_WITHIN_S = 60.0


def repair(
    path: Path,
    log: CaptureLog,
    stop_wall_ns: int | None,
    *,
    account: Mapping[str, Any],
    stopped: Event,
    last_try: bool,
) -> Settlement | None:
    """One attempt; None while capture does not answer. Raises DamagedLog, OSError.

    ``account`` is what is known of it; the rest is as in ``reconcile``. What the
    ``last_try`` does not bring is missing.
    """
    try:
        log.standing()
    except NoAnswer:
        if not last_try:
            return None
    found = settle(path, log, stop_wall_ns, account=account, patience=Patience(REPAIR_WITHIN_S, stopped))
    return found.given_up() if last_try else found


def settle(
    path: Path,
    log: CaptureLog,
    stop_wall_ns: int | None,
    *,
    account: Mapping[str, Any],
    patience: Patience,
) -> Settlement:
    """The account of a closed file, repaired as far as ``patience`` allows; ``account``: what is known."""
    file = RunLedger.resume(path, account.get(FINDINGS))
    try:
        outcome = reconcile_and_compare(file, log, stop_wall_ns, patience)
    finally:
        file.close()
    return Settlement.of(file, outcome, refused=account.get("refused", 0))


STOP_WITHIN_S = 5.0


def run_recorder(settings: Settings, stopped: Event, started: Callable[[], None] | None = None) -> None:
    """Carry out recordings and samplings until ``stopped``; waits for the router at the start."""
    pin_blas_to_one_thread()
    try:
        with open_client([settings.zenoh], cancelled=stopped.is_set) as session:
            if started is not None:
                started()
            owners = GloveOwners(session, settings.site, f"{_place(settings)}{secrets.token_hex(4)}")
            owners.announce()
            samplings = SamplingRunner(session, settings, lambda: Store.open(settings), owners)
            thread = Thread(target=samplings.run, args=(stopped,), name="samplings", daemon=True)
            thread.start()
            Recorder(session, settings, lambda: Store.open(settings), owners).run(stopped)
            thread.join(STOP_WITHIN_S)
            owners.close()
    except NoAnswer:
        if not stopped.is_set():
            raise
