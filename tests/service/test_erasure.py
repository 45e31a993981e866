"""A subject is erased: nothing of it is left in the data folder, the log of changes holds, a kill is made up
for."""

from __future__ import annotations

import hashlib
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from filled_store import META, fill
from sqlalchemy import select, update
from stored_takes import LAYOUT, make_take

from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store import Store, tables
from glovecal_service.store.erasure import erase, finish_erasures
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.list_part import ListPart

KILLED_AT = {
    "the transaction": ("audit_trail", "_append", 0),
    "the first file": ("erasure", "_unlink", 0),
    "the third file": ("erasure", "_unlink", 2),
    "the database's file": ("erasure", "_note", 1),
}
"""Function of the store at whose call, after so many others, the process is killed."""
ERASING = """
import os, signal, sys
from pathlib import Path
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store import {module} as module
from glovecal_service.store.erasure import erase

calls, original = [], module.{function}
def killed(*given, **named):
    calls.append(1)
    if len(calls) > {after}:
        os.kill(os.getpid(), signal.SIGKILL)
    return original(*given, **named)
module.{function} = killed
settings = Settings(data=Path(sys.argv[1]), database=sys.argv[2] or None)
with Store.open(settings) as store:
    erase(store, settings, "anna")
"""


def put(file: Path, content: bytes) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content)
    return file


def settled(store: Store, settings: Settings) -> dict[str, Path]:
    """Anna and ben; nothing goes on. Files of anna's, by what they are."""
    fill(store)
    for recording in store.recordings.unsettled():
        store.recordings.update(recording.id, state="done")
    for sampling in store.samplings.list(only_open=True):
        store.samplings.note(sampling.id, open=False)
    for job in store.jobs.list(only_unfinished=True):
        store.jobs.request_cancel(job.id)
    store.subjects.measure("anna", {"hand_length": 187.5})
    original = hashlib.sha256(b"original").hexdigest()
    take = store.takes.add(
        make_take(7, "given"), subject="anna", layout=LAYOUT.name, source="import", original_sha256=original
    )
    gone = store.takes.add(make_take(9, "gone"), subject="anna", layout=LAYOUT.name, source="import")
    store.takes.remove(gone.id)
    store.takes.attach_reference(
        take.id, make_take(7).reference_time_s + 0.01, ("I_MCP",), make_take(7).reference[:, :1]
    )
    store.gloves.seen("left", {**META, "subject": "anna", "wearing": "w"})
    store.gloves.assign("left", "ben", "his")
    store.gloves.assign("left", "anna", "hers")
    store.keys.create("both", "trainer", ["anna", "ben"])
    recording = store.recordings.list()[-1]
    return {
        "original": put(settings.uploads_folder / original, b"original"),
        "video": put(settings.videos_folder / f"{take.id}.zip", b"anna's video"),
        "raw": put(settings.recordings_folder / f"{recording.id}.glog", b"anna's frames"),
        "take": settings.artifacts_folder / store.takes.get(take.id).artifact,
        "earlier": settings.artifacts_folder / take.artifact,
        "removed before": settings.artifacts_folder / gone.artifact,
        "model": settings.artifacts_folder / store.models.list("anna")[0].id,
        "cached": put(settings.fits_folder / "0123456789abcdef.00.safetensors", b"of somebody's takes"),
    }


def naming(folder: Path, name: bytes) -> list[str]:
    return [path.name for path in folder.rglob("*") if path.is_file() and name in path.read_bytes()]


def everything(store: Store) -> str:
    """All that stands in the database."""
    with store.database.read() as connection:
        rows = [connection.execute(select(table)).all() for table in tables.metadata.sorted_tables]
    return repr([[list(map(_plain, row)) for row in of_table] for of_table in rows])


def _plain(value: Any) -> Any:
    return getattr(value, "document", value)


def test_nothing_is_left_of_who_was_erased_and_others_keep_theirs(
    store: Store, store_settings: Settings
) -> None:
    files = settled(store, store_settings)
    shared = make_take(3, "the same")
    for name in ("anna", "ben"):
        store.takes.add(shared, subject=name, layout=LAYOUT.name, source="import")
    his = store.takes.add(make_take(8, "his"), subject="ben", layout=LAYOUT.name, source="import")
    store.jobs.create("compare", {"takes": [store.takes.list("anna")[0].id]}, subject="ben")
    claimed = store.jobs.claim("worker")
    assert claimed is not None
    store.jobs.finish(claimed.id, claimed.attempt, {"rmse_deg": 1.0})
    kept = store.jobs.create("compare", {"takes": [his.id]}, subject="ben")
    store.subjects.create("left")
    assert all(file.is_file() for file in files.values())
    before = store.audit.count

    erasure = erase(store, store_settings, "anna")

    assert erasure.is_finished
    counts = {"takes": 4, "models": 2, "recordings": 2, "samplings": 1, "jobs": 4}
    assert {table: erasure.removed[table] for table in counts} == counts
    assert [name for name, file in files.items() if file.exists()] == []
    assert "anna" not in everything(store)
    assert naming(store_settings.data, b"anna") == []
    with pytest.raises(NotFound):
        store.subjects.get("anna")
    assert {take.name for take in store.takes.list("ben")} == {"his", "the same"}
    assert len(store.takes.load(store.takes.list("ben")[0].id).time_s) == 300
    assert [job.id for job in store.jobs.list()] == [kept.id]
    assert store.gloves.get("left").subject is None
    assert "subject" not in store.gloves.get("left").meta
    assert [key.subjects for key in store.keys.list()] == [("ben",)]
    assert {subject.name for subject in store.subjects.list()} == {"ben", "left"}
    assert erasure.capture_logs == ["left"]
    assert any("made elsewhere still hold the subject" in sentence for sentence in erasure.sentences)

    assert store.audit.problems() == []
    assert store.audit.count == before + 1
    (newest,) = store.audit.page(ListPart(limit=1)).records
    proof = newest.changes[0]
    assert proof["key"] == f"erased-{erasure.id}"
    assert proof["after"]["removed"]["takes"] == 4
    assert hashlib.sha256(b"anna's frames").hexdigest() in proof["after"]["sha256"]
    his_entries = [entry for entry in store.audit.every() if "his" in json.dumps(entry.changes)]
    assert his_entries
    store.subjects.create("anna")
    assert store.takes.list("anna") == []


def test_what_an_erasure_rewrote_is_guarded_as_before(store: Store, store_settings: Settings) -> None:
    settled(store, store_settings)
    store.subjects.create("carl")
    erase(store, store_settings, "anna")
    erase(store, store_settings, "ben")
    assert store.audit.problems() == []
    with store.database.write() as connection:
        connection.execute(update(tables.audit).where(tables.audit.c.id == 1).values(who="somebody"))
    assert store.audit.problems() == ["entry 1 was changed after it was written"]
    erase(store, store_settings, "carl")
    assert store.audit.problems() == ["entry 1 was changed after it was written"]


def test_what_was_tampered_with_before_is_not_whitewashed(store: Store, store_settings: Settings) -> None:
    settled(store, store_settings)
    with store.database.write() as connection:
        connection.execute(update(tables.audit).where(tables.audit.c.id == 1).values(who="somebody"))
    erase(store, store_settings, "anna")
    assert store.audit.problems() == ["entry 1 was changed after it was written"]


@pytest.mark.parametrize("what", ["recording", "sampling", "job"])
def test_while_something_goes_on_nothing_is_erased(store: Store, store_settings: Settings, what: str) -> None:
    files = settled(store, store_settings)
    if what == "recording":
        store.recordings.request("left", name="now", subject="anna", wearing="w")
    elif what == "sampling":
        store.samplings.create(glove="left", subject="anna", wearing="w", layout=LAYOUT.name, document={})
    else:
        store.jobs.create("train", {}, subject="anna")
    before = everything(store)
    with pytest.raises(Conflict, match=r"then erase the subject"):
        erase(store, store_settings, "anna")
    assert everything(store) == before
    assert all(file.is_file() for file in files.values())


@pytest.mark.parametrize("at", KILLED_AT)
def test_killed_in_the_middle_it_is_done_at_the_next_start_or_was_not_begun(
    store_settings: Settings, at: str
) -> None:
    with Store.open(store_settings) as store:
        files = settled(store, store_settings)
    module, function, after = KILLED_AT[at]
    code = ERASING.format(module=module, function=function, after=after)
    command = [sys.executable, "-c", code, str(store_settings.data), store_settings.database or ""]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == -signal.SIGKILL, done.stderr
    with in_process_client(store_settings):  # the next start of whatever
        pass
    with Store.open(store_settings) as store:
        assert store.audit.problems() == []
        if at == "the transaction":
            assert store.takes.list("anna")
            assert all(file.is_file() for file in files.values())
            erase(store, store_settings, "anna")
        assert "anna" not in everything(store)
        assert [name for name, file in files.items() if file.exists()] == []
        assert naming(store_settings.data, b"anna") == []
        with store.database.read() as connection:
            assert connection.scalars(select(tables.erasures.c.finished_at)).one() is not None


def test_a_file_that_cannot_be_removed_is_tried_again(
    sqlite_store: Store, sqlite_settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = settled(sqlite_store, sqlite_settings)
    original = Path.unlink

    def refused(path: Path, missing_ok: bool = False) -> None:
        if path == files["raw"]:
            raise PermissionError(13, "held by a virus scanner")
        original(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", refused)
    erasure = erase(sqlite_store, sqlite_settings, "anna")
    assert not erasure.is_finished
    assert any("tried again" in sentence for sentence in erasure.sentences)
    assert [name for name, file in files.items() if file.exists()] == ["raw"]
    monkeypatch.setattr(Path, "unlink", original)
    assert finish_erasures(sqlite_store, sqlite_settings)
    assert not files["raw"].exists()
