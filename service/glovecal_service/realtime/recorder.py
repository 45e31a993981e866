"""Carries out the recordings that the store asks for, through restarts and full disks."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path
from threading import Event
from typing import Any

import zenoh
from sqlalchemy.exc import SQLAlchemyError

from glovecal_client.errors import ClientError, NoAnswer
from glovecal_client.keys import GloveKeys
from glovecal_client.queries import ask_json
from glovecal_models.errors import GlovecalError
from glovecal_service.realtime.lead_in_wish import LeadInWish, lead_in_wish
from glovecal_service.realtime.live_recording import LiveRecording
from glovecal_service.realtime.recording_file import SUFFIX, RecordingFile
from glovecal_service.realtime.recording_result import keep_as_take
from glovecal_service.settings import Settings
from glovecal_service.store.clock import now
from glovecal_service.store.errors import (
    DamagedRows,
    NotFound,
    StorageFull,
    StoreDamaged,
    StoreError,
    StoreUnavailable,
)
from glovecal_service.store.recordings import LEAD_IN
from glovecal_service.store.records import RecordingRecord
from glovecal_service.store.store import Store

LOOK_EVERY_S = 0.05
REPORT_EVERY_S = 1.0
RESUME_WITHIN_S = 60.0
"""A recording interrupted for longer is finished as it is: nobody meant the hours in between."""

_log = logging.getLogger("glovecal.recorder")


class Recorder:
    """One thread for all recordings. ``look`` does a round of work; call it again and again."""

    def __init__(self, session: zenoh.Session, settings: Settings, open_store: Callable[[], Store]) -> None:
        self._session = session
        self._settings = settings
        self._open_store = open_store
        self._store: Store | None = None
        self._revision: int | None = None
        self._looked_at = 0.0
        self._reported_at = 0.0
        self._live: dict[str, LiveRecording] = {}
        self._unfinished: dict[str, dict[str, Any]] = {}
        """Recordings whose file is closed and whose take is not stored yet, with their accounts."""

    def run(self, stopped: Event) -> None:
        """Until ``stopped``; recordings that go on are left for the next process to resume."""
        while not stopped.wait(LOOK_EVERY_S):
            self.look()
        for live in self._live.values():
            live.abandon()
        if self._store is not None:
            self._store.close()

    def look(self) -> None:
        """Write what arrived, repair gaps, follow the store, report. Nothing here raises."""
        for id, live in list(self._live.items()):
            try:
                live.take_in()
                live.take_lead_in()
                live.repair_now_and_then()
            except (ClientError, OSError, ValueError) as error:
                self._note(id, sentence=f"recording goes on with trouble: {error}")
        now = time.monotonic()
        try:
            if now - self._looked_at >= 2 * LOOK_EVERY_S:
                self._looked_at = now
                self._follow(self._opened())
            if now - self._reported_at >= REPORT_EVERY_S:
                self._reported_at = now
                self._report(self._opened())
        except (StoreError, SQLAlchemyError, OSError) as error:
            _log.warning("the store does not answer, recordings go on: %s", error)
            self._looked_at = now + REPORT_EVERY_S

    def _opened(self) -> Store:
        if self._store is None:
            self._store = self._open_store()
        return self._store

    def _follow(self, store: Store) -> None:
        revision = store.revision()
        if revision != self._revision:
            records = _sound_recordings(store, only_open=True)
            settled = [self._move(store, record) for record in records]
            self._revision = revision if all(settled) else None

    def _move(self, store: Store, record: RecordingRecord) -> bool:
        """Bring a recording one state on; False if that has to be tried again."""
        try:
            if record.id not in self._live and record.id not in self._unfinished:
                record = self._begin(store, record)
            if record.state == "stopping" and record.id in self._live:
                self._end(record)
            if record.state == "stopping" and record.id in self._unfinished:
                self._finish(store, record)
        except (StoreUnavailable, SQLAlchemyError):
            raise
        except StorageFull as error:
            self._note(record.id, sentence=f"goes on as soon as there is room: {error}")
            self._looked_at = time.monotonic() + REPORT_EVERY_S
            return False
        except (GlovecalError, ClientError, OSError, ValueError) as error:
            self._fail(store, record, str(error))
        return True

    def _begin(self, store: Store, record: RecordingRecord) -> RecordingRecord:
        keys = GloveKeys(self._settings.site, record.glove)
        path = self._settings.recordings_folder / f"{record.id}{SUFFIX}"
        interrupted = path.exists()
        file = RecordingFile.resume(path) if interrupted else self._create(store, record, keys, path)
        wish = LeadInWish.of_document(file.meta.get(LEAD_IN))
        self._live[record.id] = LiveRecording(self._session, keys, file, wish)
        facts = {}
        if interrupted:
            facts["interruptions"] = [*record.facts.get("interruptions", []), _interruption(file)]
        _log.info(
            "recording %s of glove %s %s", record.name, record.glove, "resumed" if interrupted else "began"
        )
        record = store.recordings.update(record.id, state="recording", sentence="recording", **facts)
        silent_s = time.time() - file.last_wall_ns / 1e9
        if interrupted and (record.state == "stopping" or silent_s > RESUME_WITHIN_S):
            return self._end_interrupted(store, record)
        return record

    def _create(self, store: Store, record: RecordingRecord, keys: GloveKeys, path: Path) -> RecordingFile:
        try:
            capture = ask_json(self._session, keys.meta, timeout_s=5.0)
        except NoAnswer:
            capture = _stored_meta(store, record.glove)
        meta: dict[str, Any] = {
            "recording": record.id,
            "name": record.name,
            "glove": record.glove,
            "capture": capture,
        }
        others = _sound_recordings(store, record.glove)
        meta[LEAD_IN] = lead_in_wish(record, store.gloves.get(record.glove), others, now()).document()
        try:
            return RecordingFile.create(path, meta)
        except OSError as error:
            raise StorageFull(f"recording {record.name}: {path.name} cannot be written: {error}") from error

    def _end_interrupted(self, store: Store, record: RecordingRecord) -> RecordingRecord:
        """Close it with the last frame it had; gaps before that are still repaired."""
        live = self._live.pop(record.id)
        live.repair()
        live.abandon()
        self._unfinished[record.id] = live.account() | {"end_known": False}
        return store.recordings.stop(record.id)

    def _end(self, record: RecordingRecord) -> None:
        live = self._live.pop(record.id)
        known = live.finish()
        self._unfinished[record.id] = live.account() | {"end_known": known}

    def _finish(self, store: Store, record: RecordingRecord) -> None:
        account = self._unfinished[record.id]
        facts = keep_as_take(store, record, account, self._settings.recordings_folder)
        store.recordings.update(record.id, state="done", **account, **facts)
        del self._unfinished[record.id]
        _log.info("recording %s: %s", record.name, facts["sentence"])

    def _fail(self, store: Store, record: RecordingRecord, problem: str) -> None:
        _log.warning("recording %s failed: %s", record.name, problem)
        live = self._live.pop(record.id, None)
        if live is not None:
            live.abandon()
        account = self._unfinished.pop(record.id, {} if live is None else live.account())
        store.recordings.update(record.id, state="failed", sentence=problem, **account)

    def _report(self, store: Store) -> None:
        for id, live in self._live.items():
            live.file.sync()
            problem = live.file.problem
            sentence = f"frames wait in memory: {problem}" if problem else "recording"
            try:
                store.recordings.update(id, sentence=sentence, **live.account())
            except StoreDamaged as error:  # its frames are written all the same, the others are reported
                _log.warning("recording %s cannot be reported: %s", id, error)

    def _note(self, id: str, **facts: Any) -> None:
        _log.warning("recording %s: %s", id, facts)
        try:
            self._opened().recordings.update(id, **facts)
        except (StoreError, SQLAlchemyError, OSError):
            return


def _sound_recordings(
    store: Store, glove: str | None = None, *, only_open: bool = False
) -> list[RecordingRecord]:
    try:
        return store.recordings.list(glove, only_open=only_open)
    except DamagedRows as error:
        _log.warning("recordings that cannot be read: %s", "; ".join(error.damaged))
        return error.sound


def _interruption(file: RecordingFile) -> dict[str, Any]:
    return {"last_frame_wall_s": file.last_wall_ns / 1e9, "resumed_wall_s": time.time()}


def _stored_meta(store: Store, glove: str) -> dict[str, Any]:
    try:
        return dict(store.gloves.get(glove).meta)
    except NotFound:
        return {}
