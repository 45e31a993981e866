"""What a data folder need not keep for ever: swept once an hour, the oldest first.

Kept whatever their age: database, artifacts, and each upload that a stored take came from. Swept
``GLOVECAL_KEEP_DAYS`` after they were last written: uploads that no take came from, films (a take's video is
a copy in ``videos``), the ledgers of recordings that became takes, and the steps of jobs that are over. A
recording that failed has its frames nowhere else, and stays. A job goes with its result
``GLOVECAL_KEEP_JOBS_DAYS`` after it was over, where a later one of its kind and subject was done.

Ledgers that are not written to any more are packed meanwhile, to about a seventh. Where there is an object
store, files that nobody writes to any more are sent there.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from glovecal_client.encryption.kept_file import UNFINISHED, is_packed, pack_log
from glovecal_client.errors import ClientError
from glovecal_models.presentation.document import counted
from glovecal_service.plain import reason_of
from glovecal_service.settings import Settings
from glovecal_service.store.blobs import SHA256_NAME
from glovecal_service.store.database import now
from glovecal_service.store.encrypt_folder import LOGS
from glovecal_service.store.errors import NotFound, StoreDamaged, StoreError
from glovecal_service.store.list_part import ListPart
from glovecal_service.store.store import Store

DAY_S = 86_400.0
BECAME_A_TAKE = "done"
PACKED_AFTER_S = 3600.0
TAKES_AT_ONCE = 200
log = logging.getLogger("glovecal.store")


@dataclass(frozen=True)
class Swept:
    files: int = 0
    size_bytes: int = 0
    job_steps: int = 0
    jobs: int = 0
    packed: int = 0
    """Ledgers."""

    def __bool__(self) -> bool:
        return bool(self.files or self.job_steps or self.jobs or self.packed)

    def __str__(self) -> str:
        files = f"{counted(self.files, 'file')} of {self.size_bytes / 1e6:.1f} MB"
        steps = f"{counted(self.job_steps, 'step')} of jobs that are over"
        jobs = f"{steps}, {counted(self.jobs, 'job')} with what was found"
        packed = f"; packed: {counted(self.packed, 'ledger')} of recordings" if self.packed else ""
        return f"{files}, {jobs}{packed}"


def sweep(store: Store, settings: Settings) -> Swept:
    """Remove what is older than ``settings.keep_days``, and jobs older than ``settings.keep_jobs_days``.
    Nothing where the store does not answer."""
    before = time.time() - settings.keep_days * DAY_S
    count = size = 0
    try:
        steps = store.jobs.forget_steps(now() - timedelta(days=settings.keep_days))
        jobs = store.jobs.forget(now() - timedelta(days=settings.keep_jobs_days))
        store.files.forget_gone(now() - timedelta(days=settings.keep_days))
        candidates = [
            *_uploads(store, before), *store.files.older("films", before), *_ledgers(store, before)
        ]  # fmt: skip
    except StoreError:  # what came from an upload is not known now: another time
        return Swept()
    for file in candidates:
        with suppress(OSError, StoreError):
            size += store.files.remove(file)
            count += 1
    return Swept(count, size, steps, jobs, sum(_pack(store, file) for file in _left_alone(settings)))


def _left_alone(settings: Settings) -> Iterator[Path]:
    return _old(settings.recordings_folder, time.time() - PACKED_AFTER_S)


def _pack(store: Store, file: Path) -> bool:
    """A ledger of a take; what cannot be packed stays as it is."""
    try:
        return (
            file.suffix in LOGS
            and not is_packed(file)
            and _became_a_take(store, file.name)
            and pack_log(file)
        )
    except (OSError, ClientError) as error:
        log.warning("ledger %s is not packed: %s", file.name, reason_of(error))
        return False


def _old(folder: Path, before: float) -> Iterator[Path]:
    """Files last written before that Unix time."""
    for file in folder.glob("*"):
        with suppress(OSError):
            if file.is_file() and file.stat().st_mtime < before:
                yield file


def _uploads(store: Store, before: float) -> list[str]:
    """Raises StoreError, also where a damaged row may have named one of them."""
    old = [file for file in store.files.older("uploads", before) if SHA256_NAME.match(_name(file))]
    if not old:
        return []
    used, part = set(), ListPart(limit=TAKES_AT_ONCE)
    while True:
        page = store.takes.page(part)
        if page.damaged:
            raise StoreDamaged(page.damaged[0])
        used |= {take.original_sha256 for take in page.records}
        if page.after is None:
            return [file for file in old if _name(file) not in used]
        part = ListPart(limit=TAKES_AT_ONCE, after=page.after)


def _ledgers(store: Store, before: float) -> Iterator[str]:
    old = store.files.older("recordings", before)
    return (file for file in old if _became_a_take(store, _name(file)))


def _name(file: str) -> str:
    return file.rpartition("/")[2]


def send_files(store: Store, settings: Settings) -> int:
    """To the object store, what nobody here writes to any more and is not there yet; how many were sent. Of a
    recording its ledger once it is packed."""
    recordings = settings.recordings_folder

    def is_whole(path: Path) -> bool:
        if path.parent != recordings:
            return True
        is_log = path.suffix in LOGS
        return (not is_log or is_packed(path)) and _became_a_take(store, path.name)

    return store.files.send(_settled(settings), is_whole) if store.files.are_shared else 0


def _settled(settings: Settings) -> Iterator[Path]:
    yield from (path for path in settings.uploads_folder.glob("*") if SHA256_NAME.match(path.name))
    yield from settings.videos_folder.glob("*.zip")
    for about in settings.films_folder.glob("*.json"):  # written at its end
        yield from settings.films_folder.glob(f"{about.stem}.*")
    yield from (path for path in _left_alone(settings) if UNFINISHED not in path.name)


def _became_a_take(store: Store, ledger: str) -> bool:
    """Raises StoreError where the store does not answer."""
    try:
        return store.recordings.get(ledger.partition(".")[0]).state == BECAME_A_TAKE
    except (NotFound, StoreDamaged):
        return False
