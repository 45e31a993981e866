"""A subject is erased: its rows in one transaction, which leaves a list of its files; then the files.

Killed before the transaction ends nothing has happened; killed later the next start removes the files that
are left. In the log of changes stays who, when and what by counts and hashes; older entries lose the
subject's name and values. Their own hashes stay, so the chain does, and the entry of the erasure holds the
hash of what each says now: ``Audit.problems`` takes that, and nothing else, for what was written.
"""

from __future__ import annotations

import hashlib
import logging
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, Table, delete, insert, select, update

from glovecal_client.errors import DamagedFile
from glovecal_models.errors import GlovecalError
from glovecal_service.operating_system import as_typed
from glovecal_service.settings import Settings
from glovecal_service.store import tables
from glovecal_service.store.audit import REWRITTEN, Audit, AuditEntry
from glovecal_service.store.audit_trail import entry_sha256, tell_instead
from glovecal_service.store.belongings import (
    Belongings,
    artifacts_of,
    films_of,
    recording_files,
)
from glovecal_service.store.changes import tell_forgotten_subject
from glovecal_service.store.damages import forget_damages_of
from glovecal_service.store.database import new_id, now
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import OPEN_RECORDING_STATES, JobRecord
from glovecal_service.store.row_hash import change_rows
from glovecal_service.store.shared_files import ARTIFACTS as GONE_ARTIFACTS
from glovecal_service.store.store import Store
from glovecal_service.store.subject_audit import SubjectAudit, names_subject
from glovecal_service.store.subjects import require_subject
from glovecal_service.store.take_file import video_of
from glovecal_service.store.texts import json_text

ERASED = "erased"
"""What stands in older entries of the log of changes in the place of a value."""
ARTIFACTS, DATA = "artifacts", "data"
"""Where a file lies: named by its sha256, or by its path below the data folder."""
UNSETTLED = (*OPEN_RECORDING_STATES, "repairing")
_OWN = (
    tables.activations, tables.model_takes, tables.models, tables.takes, tables.recordings, tables.samplings,
    tables.jobs,
)  # fmt: skip
"""In an order in which no row that is left refers to one that is gone."""
_log = logging.getLogger("glovecal.store")


@dataclass(frozen=True)
class Backup:
    file: str
    written_at: datetime


@dataclass(frozen=True)
class ErasureRecord:
    id: str
    """Stands for the subject in the log of changes, as ``erased-ID``."""
    is_finished: bool
    """False where files could not be removed yet; that is tried again once an hour and at each start."""
    removed: dict[str, int]
    """Rows by table, and ``files``."""
    rewritten_entries: int
    """Of the log of changes: they no longer say who it was."""
    backups: list[Backup]
    """In the data folder, older than the erasure: they still hold the subject."""
    capture_logs: list[str]
    """Gloves whose capture computers may keep frames in their logs."""
    sentences: list[str]
    """What was done, and what else is left, for a person."""


def erase(store: Store, settings: Settings, name: str) -> ErasureRecord:
    """Remove all that is kept of a subject. Raises NotFound, and Conflict while a recording, a sampling or a
    job of it goes on; then nothing was changed."""
    of = Belongings.of(store, name)
    audit = SubjectAudit(store.audit, name, of.ids)
    jobs = of.jobs + [job for job in _jobs(store) if job.subject != name and _mentions(job, name, audit.ids)]
    _require_idle(of, jobs)
    files = _files(store, of, audit, settings)
    hashed = [{**file, "sha256": _sha256(store, settings, file)} for file in files]
    id = new_id()
    rewriting = _Rewriting(store.audit, audit, f"{ERASED}-{id}")
    with store.database.write() as connection:
        _require_as_seen(connection, of)
        removed = _remove_rows(connection, of, jobs)
        rewriting.write(connection)
        tell_forgotten_subject(connection, name)
        connection.execute(insert(tables.erasures).values(id=id, files=files, began_at=now()))
        store.files.note_gone(connection, _also_elsewhere(of, files) - _used(connection))
        counted = {**removed, "files": len(files)}
        proof = {"removed": counted, "sha256": sorted(file["sha256"] for file in hashed if file["sha256"])}
        tell_instead(
            connection,
            [{"table": tables.subjects.name, "key": f"{ERASED}-{id}", "after": proof}, *rewriting.notes],
        )
    is_finished = finish_erasures(store, settings)
    gloves = sorted({row.glove for row in of.recordings} | {glove.name for glove in of.gloves})
    erasure = ErasureRecord(id, is_finished, counted, len(rewriting.notes), _backups(store), gloves, [])
    return replace(erasure, sentences=[*_done(erasure), *_remaining(store, settings, of)])


def _done(erasure: ErasureRecord) -> list[str]:
    sentences = [
        f"Erased as {erasure.id}. Entries of the log of changes that no longer say who it was: "
        f"{erasure.rewritten_entries}."
    ]
    if not erasure.is_finished:
        sentences.append("Some files cannot be removed now: tried again once an hour and at each start.")
    sentences += [
        f"Perhaps still in the backup {backup.file} of {backup.written_at:%Y-%m-%d}, in the data folder: "
        "remove it by hand."
        for backup in erasure.backups
    ]
    sentences += [
        f"Frames of glove {glove} may still be in the log of its capture computer, in the folder capture."
        for glove in erasure.capture_logs
    ]
    return sentences


def finish_erasures(store: Store, settings: Settings) -> bool:
    """Remove the files of erasures that are not finished, and what their rows left in the database's file;
    whether all are finished now. What cannot be removed is tried again by the next call. Raises
    StoreError."""
    table = tables.erasures
    unfinished = table.c.finished_at.is_(None)
    with store.database.read() as connection:
        waiting = connection.execute(select(table.c.id, table.c.files).where(unfinished))
        erasures = {id: getattr(files, "document", files) for id, files in waiting}
        used = _used(connection) if erasures else set()
    if not erasures:
        return True
    for cached in settings.fits_folder.glob("*.safetensors"):
        cached.unlink(missing_ok=True)  # computed from takes, nobody knows of whose
    for id, files in erasures.items():
        left = [file for file in files if file["name"] not in used and not _unlink(store, settings, file)]
        _note(store, id, files=left)
        erasures[id] = left
    if any(erasures.values()) or not store.database.forget_deleted_rows():
        return False
    for id in erasures:
        _note(store, id, finished_at=now())
    return True


def _note(store: Store, id: str, **values: Any) -> None:
    with store.database.write() as connection:
        connection.execute(update(tables.erasures).where(tables.erasures.c.id == id).values(**values))


def _require_idle(of: Belongings, jobs: Iterable[JobRecord]) -> None:
    name = of.subject.name
    for recording in of.recordings:
        if recording.state in UNSETTLED:
            raise Conflict(
                f"recording {recording.name!r} of subject {name!r} is {recording.state}: stop it and wait "
                "until its take is complete, then erase the subject"
            )
    for sampling in of.samplings:
        if sampling.open:
            raise Conflict(
                f"a sampling of subject {name!r} goes on with glove {sampling.glove!r}: end it, then "
                "erase the subject"
            )
    for job in jobs:
        if not job.is_finished:
            raise Conflict(
                f"job {job.id} ({job.kind}) works with subject {name!r} and is {job.state}: wait, or end it "
                f"with glovecal job cancel {job.id}, then erase the subject"
            )


def _require_as_seen(connection: Connection, of: Belongings) -> None:
    """Raises Conflict where rows of the subject came meanwhile: their files were not looked at."""
    name = of.subject.name
    require_subject(connection, name)
    for table in (tables.takes, tables.models, tables.recordings, tables.samplings, tables.jobs):
        ids = connection.scalars(select(table.c.id).where(table.c.subject == name))
        if new := sorted(set(ids) - of.ids):
            raise Conflict(
                f"{table.name} of subject {name!r} came while it was erased ({new[0]}); nothing was changed: "
                "erase it again"
            )
    going_on = select(tables.recordings.c.id).where(
        tables.recordings.c.subject == name, tables.recordings.c.state.in_(UNSETTLED)
    )
    if connection.scalar(going_on.limit(1)):
        raise Conflict(
            f"a recording of subject {name!r} began while it was erased: stop it, then erase again"
        )


def _remove_rows(connection: Connection, of: Belongings, jobs: Iterable[JobRecord]) -> dict[str, int]:
    name = of.subject.name
    models = select(tables.models.c.id).where(tables.models.c.subject == name)
    children = tables.models.c.parent.in_(models) & (tables.models.c.subject != name)
    change_rows(connection, tables.models, children, {"parent": None})
    removed: Counter[str] = Counter()
    for table in _OWN:
        which = (
            tables.model_takes.c.model.in_(models) if table is tables.model_takes else table.c.subject == name
        )
        removed[table.name] += connection.execute(delete(table).where(which)).rowcount
    forget_damages_of(connection, name)
    others = [job.id for job in jobs if job.subject != name]
    removed[tables.jobs.name] += _delete_ids(connection, tables.jobs, others)
    for glove in connection.execute(select(tables.gloves)).all():
        meta = getattr(glove.meta, "document", glove.meta)
        is_assigned, is_announced = glove.subject == name, meta.get("subject") == name
        if is_assigned or is_announced:
            kept = {key: value for key, value in meta.items() if key not in ("subject", "wearing")}
            nobody = {"subject": None, "wearing": None} if is_assigned else {}
            changed = update(tables.gloves).where(tables.gloves.c.name == glove.name)
            connection.execute(changed.values(meta=kept if is_announced else meta, **nobody))
    for key in connection.execute(select(tables.keys.c.name, tables.keys.c.subjects)).all():
        subjects = getattr(key.subjects, "document", key.subjects)
        if subjects and name in subjects:
            fewer = {"subjects": [each for each in subjects if each != name]}
            change_rows(connection, tables.keys, tables.keys.c.name == key.name, fewer)
    connection.execute(delete(tables.subjects).where(tables.subjects.c.name == name))
    return dict(removed)


def _delete_ids(connection: Connection, table: Table, ids: list[str]) -> int:
    return sum(connection.execute(delete(table).where(table.c.id == id)).rowcount for id in ids)


class _Rewriting:
    """Takes the subject out of older entries. All of the log is read before the transaction, in which others
    wait; what was written since, in it."""

    def __init__(self, audit: Audit, of: SubjectAudit, stand_in: str) -> None:
        self._audit, self._of, self._stand_in = audit, of, stand_in
        self._last = 0
        self._entries: list[AuditEntry] = []
        self.notes: list[dict[str, Any]] = []
        """Changes that say so."""
        for entry, is_sound in audit.every_with_soundness():
            self._add(entry, is_sound)

    def write(self, connection: Connection) -> None:
        for entry in self._audit.every(self._last):
            self._add(entry, is_sound=True)
        for entry in self._entries:
            columns = {"action": entry.action, "changes": entry.changes}
            connection.execute(update(tables.audit).where(tables.audit.c.id == entry.id).values(**columns))

    def _add(self, entry: AuditEntry, is_sound: bool) -> None:
        self._last = entry.id
        if not self._of.concerns(entry):
            return
        written = self._of.without_subject(entry, self._stand_in, ERASED)
        self._entries.append(written)
        if is_sound:  # one that was tampered with before stays so
            note = {"sha256": entry_sha256(vars(written))}
            self.notes.append({"table": REWRITTEN, "key": str(entry.id), "after": note})


def _jobs(store: Store) -> list[JobRecord]:
    return store.jobs.list()


def _mentions(job: JobRecord, name: str, ids: set[str]) -> bool:
    """Whether somebody else's job says something of the subject."""
    documents = [job.payload, job.result, job.detail]
    if names_subject(documents, name):
        return True
    text = json_text([documents, job.sentence, job.error])
    return any(id in text for id in ids)


def _files(store: Store, of: Belongings, audit: SubjectAudit, settings: Settings) -> list[dict[str, str]]:
    """Of the subject, also those whose rows were removed before."""
    artifacts = {
        artifact for take in of.takes for artifact in artifacts_of(take.artifact, take.facts)
    } | audit.artifacts
    artifacts |= {model.id for model in of.models}
    own = {file for id in audit.ids for file in recording_files(store, id)}
    own |= {file for id in audit.ids for file in store.files.names(video_of(id))}
    originals = (take.original_sha256 for take in of.takes if take.original_sha256)
    own |= {file for sha256 in originals for file in store.files.names(f"uploads/{sha256}")}
    own |= {*films_of(store, of.takes)}
    hidden = settings.data / "hidden-effects" / of.subject.name
    own |= {path.relative_to(settings.data).as_posix() for path in hidden.rglob("*") if path.is_file()}
    return [
        *({"place": ARTIFACTS, "name": sha256} for sha256 in sorted(artifacts)),
        *({"place": DATA, "name": path} for path in sorted(own)),
    ]


def _also_elsewhere(of: Belongings, files: list[dict[str, str]]) -> set[str]:
    """With those that other services may have and did not send yet, and copies in their caches."""
    places = {DATA: "", ARTIFACTS: GONE_ARTIFACTS}
    names = {places[file["place"]] + file["name"] for file in files}
    names |= {video_of(take.id) for take in of.takes}
    names |= {f"uploads/{take.original_sha256}" for take in of.takes if take.original_sha256}
    return names | {f"recordings/{recording.id}.glog" for recording in of.recordings}


def _used(connection: Connection) -> set[str]:
    """Names of files that rows which are left refer to: whatever the state of those rows is."""
    takes = tables.takes.c
    used = set(connection.scalars(select(tables.models.c.id)))
    for artifact, original, facts in connection.execute(
        select(takes.artifact, takes.original_sha256, takes.facts)
    ):
        used |= {artifact, f"uploads/{original}"}
        history = getattr(facts, "document", {}) if not isinstance(facts, dict) else facts
        used |= {str(one.get("artifact")) for one in history.get("history", [])}
    return used


def _sha256(store: Store, settings: Settings, file: dict[str, str]) -> str:
    """ "" for what is not there."""
    if file["place"] == ARTIFACTS:
        return file["name"] if store.artifacts.exists(file["name"]) else ""
    try:
        return store.files.sha256(file["name"])
    except DamagedFile:  # goes all the same: as it lies there
        return hashlib.sha256((settings.data / file["name"]).read_bytes()).hexdigest()


def _unlink(store: Store, settings: Settings, file: dict[str, str]) -> bool:
    """Whether it is gone."""
    try:
        if file["place"] == ARTIFACTS:
            store.artifacts.remove(file["name"])
        else:
            store.files.remove(file["name"])
    except (OSError, GlovecalError):
        _log.warning("a file of an erased subject cannot be removed now: it is tried again within an hour")
        return False
    return True


def _backups(store: Store) -> list[Backup]:
    """Copies of the database that an upgrade made."""
    file = store.database.file
    if file is None:
        return []
    copies = [(copy, copy.stat().st_mtime) for copy in sorted(file.parent.glob(f"{file.name}.before-*"))]
    return [Backup(copy.name, datetime.fromtimestamp(at, UTC)) for copy, at in copies]


def _remaining(store: Store, settings: Settings, of: Belongings) -> list[str]:
    sentences = [
        "Copies of the data folder that were made elsewhere still hold the subject; they are not known here."
    ]
    if not store.database.is_sqlite:
        sentences.append("PostgreSQL frees deleted rows when it vacuums: run VACUUM, and mind its dumps.")
    capture = settings.data / "capture"
    if capture.is_dir():
        sentences.append(
            f"Logs of gloves that were captured on this computer lie in {as_typed(capture)}; each holds "
            "whoever wore the glove."
        )
    if settings.uploads_folder.is_dir() and any(settings.uploads_folder.iterdir()):
        sentences.append(
            "Uploads that no take came from do not say whose they are; they go "
            f"{settings.keep_days:g} days after they came (GLOVECAL_KEEP_DAYS)."
        )
    cameras = settings.data / "cameras"
    if cameras.is_dir() and any(path.is_file() for path in cameras.rglob("*")):
        sentences.append(f"Files of cameras in {as_typed(cameras)} do not say whose they are.")
    if of.damaged:
        sentences.append(
            f"{len(of.damaged)} rows of the database cannot be read and may be of the subject: "
            f"{'; '.join(of.damaged[:5])}"
        )
    sentences.append(
        "A capture that still announces the subject brings its name back: start it with another one, or "
        "without --subject."
    )
    return sentences
