"""What the data folder forgets after its days, and what it keeps whatever its age."""

from __future__ import annotations

import hashlib
import os
import shutil
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from filled_store import META
from sqlalchemy import text
from stored_takes import LAYOUT, make_take

from glovecal_client import Frame, FrameLog, encode_frame
from glovecal_client.encryption.kept_file import open_kept
from glovecal_service.filming import Filming
from glovecal_service.settings import Settings
from glovecal_service.store import Store, tables
from glovecal_service.store.database import now
from glovecal_service.store.errors import NotFound, StorageFull
from glovecal_service.store.list_part import ListPart
from glovecal_service.store.retention import sweep
from glovecal_service.store.row_hash import change_rows


def old(file: Path, days: float) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(file.name.encode())
    at = os.stat(file).st_mtime - days * 86_400
    os.utime(file, (at, at))
    return file


def sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def test_old_files_go_and_what_a_take_came_from_stays(store: Store, store_settings: Settings) -> None:
    settings = store_settings.model_copy(update={"keep_days": 30.0})
    store.subjects.create("anna")
    source = sha256("the take's file")
    store.takes.add(make_take(1), subject="anna", layout=LAYOUT.name, source="import", original_sha256=source)
    gloves = ("left", "right", "third")
    for glove in gloves:
        store.gloves.seen(glove, META)
    recordings = [
        store.recordings.request(glove, name="walk", subject="anna", wearing="w") for glove in gloves
    ]
    store.recordings.update(recordings[0].id, state="done", sent=1, missing=0)
    store.recordings.update(recordings[2].id, state="failed", sentence="no take came of it")
    gone = [
        old(settings.uploads_folder / sha256("forgotten"), 31),
        old(settings.films_folder / "20260101-120000-001.mkv", 31),
        old(settings.recordings_folder / f"{recordings[0].id}.run", 31),
    ]
    kept = [
        old(settings.uploads_folder / source, 1000),
        old(settings.uploads_folder / sha256("new"), 29),
        old(settings.films_folder / "20260101-120000-002.mkv", 1),
        old(settings.recordings_folder / f"{recordings[1].id}.run", 1000),
        old(settings.recordings_folder / f"{recordings[2].id}.run", 1000),
        old(settings.data / "unknown.txt", 1000),
    ]
    assert sweep(store, settings).files == 3
    assert [file.exists() for file in gone] == [False] * 3
    assert [file.exists() for file in kept] == [True] * 6
    assert len(store.takes.load(store.takes.list()[0].id).time_s) == 300


def test_old_jobs_go_with_their_results_and_the_newest_answers_stay(
    store: Store, store_settings: Settings
) -> None:
    settings = store_settings.model_copy(update={"keep_jobs_days": 10.0})
    for subject in ("anna", "ben"):
        store.subjects.create(subject)

    def done(kind: str, subject: str, days: float, *, is_done: bool = True) -> str:
        job = store.jobs.create(kind, {}, subject=subject)
        assert store.jobs.claim("worker") is not None
        ended = store.jobs.finish(job.id, 1, {}) if is_done else store.jobs.fail(job.id, 1, "no")
        at = now() - timedelta(days=days)
        with store.database.write() as connection:
            change_rows(connection, tables.jobs, tables.jobs.c.id == ended.id, {"finished_at": at})
        return job.id

    gone = [done("train", "anna", 20), done("train", "anna", 15), done("train", "anna", 14, is_done=False)]
    kept = [done("train", "anna", 13), done("diagnose", "anna", 900), done("train", "ben", 900)]
    damaged = done("train", "anna", 19)
    kept.append(store.jobs.create("train", {}, subject="anna").id)
    with store.database.write() as connection:
        connection.execute(text("UPDATE jobs SET sentence = 'other' WHERE id = :id"), {"id": damaged})
    swept = sweep(store, settings)
    assert swept.jobs == 3
    assert str(swept).endswith("steps of jobs that are over, 3 jobs with what was found")
    page = store.jobs.page(ListPart(limit=20))
    assert {job.id for job in page.records} == set(kept)
    assert len(page.damaged) == 1
    for id in gone:
        with pytest.raises(NotFound):
            store.jobs.events(id)
    assert sweep(store, settings).jobs == 0


def test_nothing_is_filmed_onto_a_disk_that_is_nearly_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=40_000_000))
    with pytest.raises(StorageFull, match=r"only 40 MB are free .* free some disk space"):
        Filming(tmp_path / "films").start("rendered")


def test_ledgers_that_are_left_alone_are_packed(sqlite_settings: Settings) -> None:
    with Store.open(sqlite_settings) as store:
        store.gloves.seen("left", META)
        recording = store.recordings.request("left", name="walk", subject=None, wearing="w")
        ledger = FrameLog.create(sqlite_settings.recordings_folder / f"{recording.id}.glog", {})
        for number in range(200):
            ledger.append(encode_frame(Frame(number, 1, number, number, np.zeros(3, np.float32))))
        ledger.close()
        content = ledger.path.read_bytes()
        assert not sweep(store, sqlite_settings), "it is not over"
        store.recordings.update(recording.id, state="done")
        assert not sweep(store, sqlite_settings), "it was written to a moment ago"
        at = os.stat(ledger.path).st_mtime - 7200
        os.utime(ledger.path, (at, at))
        assert "packed: 1 ledger of recordings" in str(sweep(store, sqlite_settings))
        assert not sweep(store, sqlite_settings)
        assert ledger.path.stat().st_size < len(content) / 5
        with open_kept(ledger.path) as file:
            assert file.read() == content
