"""What a data folder need not keep for ever: swept once an hour, the oldest first.

Kept whatever their age: database, artifacts, and each upload that a stored take came from. Swept
``GLOVECAL_KEEP_DAYS`` after they were last written: uploads that no take came from, films (a take's video is
a copy in ``videos``), the ledgers of recordings that became takes, and the steps of jobs that are over. A
recording that failed has its frames nowhere else, and stays; a job's row stays with its result.

Ledgers that are not written to any more are packed meanwhile, to about a seventh.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from glovecal_client.encryption.kept_file import pack_log
from glovecal_client.errors import ClientError
from glovecal_service.plain import reason_of
from glovecal_service.settings import Settings
from glovecal_service.store.database import now
from glovecal_service.store.encrypt_folder import LOGS
from glovecal_service.store.errors import DamagedRows, StoreError
from glovecal_service.store.store import Store

DAY_S = 86_400.0
BECAME_A_TAKE = "done"
PACKED_AFTER_S = 3600.0
log = logging.getLogger("glovecal.store")


@dataclass(frozen=True)
class Swept:
    files: int = 0
    size_bytes: int = 0
    job_steps: int = 0
    packed: int = 0
    """Ledgers."""

    def __bool__(self) -> bool:
        return bool(self.files or self.job_steps or self.packed)

    def __str__(self) -> str:
        files = f"{self.files} files of {self.size_bytes / 1e6:.1f} MB"
        packed = f"; {self.packed} ledgers of recordings were packed" if self.packed else ""
        return f"{files}, {self.job_steps} steps of jobs that are over{packed}"


def sweep(store: Store, settings: Settings) -> Swept:
    """Remove what is older than ``settings.keep_days``. Nothing where the store does not answer."""
    before = time.time() - settings.keep_days * DAY_S
    count = size = 0
    try:
        steps = store.jobs.forget_steps(now() - timedelta(days=settings.keep_days))
        candidates = [*_uploads(store, settings), *_films(settings), *_ledgers(store, settings)]
    except StoreError:  # what came from an upload is not known now: another time
        return Swept()
    for file in candidates:
        with suppress(OSError):
            about = file.stat()
            if about.st_mtime < before:
                file.unlink()
                count, size = count + 1, size + about.st_size
    return Swept(count, size, steps, sum(map(_pack, _ledgers(store, settings))))


def _pack(file: Path) -> bool:
    """A ledger that was left alone for a while; what cannot be packed stays as it is."""
    try:
        is_old = file.suffix in LOGS and file.stat().st_mtime < time.time() - PACKED_AFTER_S
        return is_old and pack_log(file)
    except (OSError, ClientError) as error:
        log.warning("ledger %s is not packed: %s", file.name, reason_of(error))
        return False


def _uploads(store: Store, settings: Settings) -> Iterator[Path]:
    """Raises StoreError, also where a damaged row may have named one of them."""
    used = {record.original_sha256 for record in store.takes.list()}
    for file in settings.uploads_folder.glob("*"):
        if file.is_file() and file.name not in used and len(file.name) == 64:
            yield file


def _films(settings: Settings) -> Iterator[Path]:
    return (file for file in settings.films_folder.glob("*") if file.is_file())


def _ledgers(store: Store, settings: Settings) -> Iterator[Path]:
    try:
        rows = store.recordings.list()
    except DamagedRows as error:
        rows = error.sound
    over = {row.id for row in rows if row.state == BECAME_A_TAKE}
    for file in settings.recordings_folder.glob("*"):
        if file.is_file() and file.name.partition(".")[0] in over:
            yield file
