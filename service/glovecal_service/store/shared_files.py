"""Files of the data folder that all services of a site have: once one is whole on the disk here, it is sent
to the object store as it lies there, encrypted or not, and any other service reads it from there.

A row of the database says which there are, when each was written and the hash of what it holds. One whose
row has no hash is gone: each service removes its own copy. A file that was written here later than its row
says is the newer one.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from sqlalchemy import Connection, delete, select

from glovecal_client.encryption.kept_file import open_kept
from glovecal_models.errors import DamagedArtifact
from glovecal_models.presentation.document import counted
from glovecal_service.plain import reason_of
from glovecal_service.store import tables
from glovecal_service.store.database import Database, now
from glovecal_service.store.errors import StoreError, StoreUnavailable
from glovecal_service.store.object_blobs import ObjectBlobs
from glovecal_service.store.row_hash import add_row, sort_out, sound_row

LOOK_AGAIN_AFTER_S = 600.0
"""At files that were sent: another service may have removed or replaced them."""
log = logging.getLogger("glovecal.store")
ARTIFACTS = "artifacts/"
"""Begins the names of artifacts that are gone, among the files'."""
_KEY = "files/"
"""Begins their names in the object store."""
_LIKE = re.compile(r"([%_\\])")


@dataclass(frozen=True)
class SharedFile:
    file: str
    """Its path below the data folder, with slashes."""
    sha256: str | None
    """Of what it holds, decrypted and unpacked; None once it is gone."""
    size_bytes: int
    """As it lies in the object store."""
    changed_at: datetime


class SharedFiles:
    """Without an object store: the files that lie here, and no others."""

    def __init__(self, database: Database, objects: ObjectBlobs | None, data: Path) -> None:
        self._database, self._objects, self.data = database, objects, data
        self._fetched_as: dict[str, str] = {}
        """Hashes of the copies in the cache."""
        self._look_at = 0.0
        """When rows are looked at though nothing is new here."""
        self._settled: dict[Path, tuple[tuple[int, int], float]] = {}
        self.waiting = ""
        """A sentence on what could not be sent at the last try."""

    @property
    def are_shared(self) -> bool:
        return self._objects is not None

    def acting_as(self, database: Database) -> SharedFiles:
        bound = copy(self)
        bound._database = database
        return bound

    def find(self, file: str) -> Path | None:
        """A file to read with ``open_kept``, fetched where it does not lie here; None where there is none.

        Raises StoreUnavailable where nobody can tell now, StorageFull, DamagedArtifact, NotFound, OSError.
        """
        own = self.data / file
        if self._objects is None:
            return own if own.is_file() else None
        try:
            row = self._row(file)
            if row is None or _is_newer(own, row):
                return own if own.is_file() else None
            if row.sha256 is None or _is_same(own, row):
                return None if row.sha256 is None else own
            return self._fetched(self._objects, row)
        except StoreUnavailable:
            if own.is_file():
                return own
            raise

    def names(self, begin: str) -> list[str]:
        """Of all that begin like this, such as ``videos/``, here or elsewhere; of those that lie here alone
        where the database does not answer."""
        folder, _, name = begin.rpartition("/")
        own = {f"{folder}/{path.name}" for path in (self.data / folder).glob(f"{name}*") if path.is_file()}
        with suppress(StoreUnavailable):
            rows = self._rows(begin)
            own |= {row.file for row in rows if row.sha256 is not None}
            own -= {
                row.file for row in rows if row.sha256 is None and not _is_newer(self.data / row.file, row)
            }
        return sorted(own)

    def note_written(self, file: str) -> None:
        """It was written here now: the newest, whatever the clocks of the services say."""
        own = self.data / file
        with suppress(StoreUnavailable):
            row = self._row(file) if self.are_shared else None
            if row is not None and not _is_newer(own, row):
                later = (row.changed_at + timedelta(milliseconds=1)).timestamp()
                os.utime(own, (later, later))

    def sha256(self, file: str) -> str:
        """Of what it holds, "" where there is none. Raises as ``find`` and ``open_kept``."""
        own = self.data / file
        if own.is_file():
            return _sha256(own)
        row = self._row(file) if self.are_shared else None
        return "" if row is None or row.sha256 is None else row.sha256

    def older(self, folder: str, before: float) -> list[str]:
        """Of a folder: what was last written before that Unix time, here or elsewhere. Raises StoreError."""
        rows = self._rows(f"{folder}/") if self.are_shared else []
        written = {row.file: row.changed_at.timestamp() for row in rows if row.sha256 is not None}
        for path in (self.data / folder).glob("*"):
            with suppress(OSError):
                if path.is_file():
                    file = f"{folder}/{path.name}"
                    written[file] = max(path.stat().st_mtime, written.get(file, 0.0))
        return sorted(file for file, at in written.items() if at < before)

    def remove(self, file: str) -> int:
        """Here, in the object store and, at their next look, at the other services; how many bytes went here.

        Raises OSError, StoreError: then ``remove`` it once more.
        """
        if self.are_shared:
            with self._database.write() as connection:
                self.note_gone(connection, [file])
        own, size = self.data / file, 0
        with suppress(FileNotFoundError):
            size = own.stat().st_size
            own.unlink()
        if self._objects is not None:
            self._objects.remove(_KEY + file)
        return size

    def note_gone(self, connection: Connection, files: Iterable[str]) -> None:
        """In the caller's transaction: nobody sends or fetches them any more."""
        for file in files if self.are_shared else ():
            _put(connection, SharedFile(file, None, 0, now()))

    def forget_gone(self, before: datetime) -> None:
        """What went before that: every service has looked since."""
        table = tables.shared_files
        with self._database.write() as connection:
            connection.execute(delete(table).where(table.c.sha256.is_(None) & (table.c.changed_at < before)))

    def only_elsewhere(self) -> Iterator[tuple[str, Path]]:
        """Fetched one by one; what cannot be fetched is left out."""
        for row in self._rows("") if self.are_shared else []:
            if row.sha256 is not None and not (self.data / row.file).is_file():
                with suppress(OSError, StoreError, DamagedArtifact):
                    found = self.find(row.file)
                    if found is not None:
                        yield row.file, found

    def send(self, paths: Iterable[Path], is_whole: Callable[[Path], bool]) -> int:
        """Send what of ``paths``, files of the data folder, is not there yet and ``is_whole``: nobody writes
        to it any more; remove what is gone. How many were sent; what cannot be sent now is told in
        ``waiting``."""
        unsettled = [path for path in paths if not self._is_settled(path)]
        if self._objects is None or not (unsettled or time.monotonic() > self._look_at):
            return 0
        sent = waiting = 0
        try:
            rows = {row.file: row for row in self._rows("")}
        except StoreError:
            return 0
        for row in rows.values():
            if row.sha256 is None:
                self._objects.forget_copy(_KEY + row.file)
                self._objects.forget_copy(row.file.removeprefix(ARTIFACTS))
        self._look_at = time.monotonic() + LOOK_AGAIN_AFTER_S
        for path in unsettled:
            file = path.relative_to(self.data).as_posix()
            try:
                sent += self._settle(self._objects, path, file, rows.get(file), is_whole)
            except FileNotFoundError:
                continue
            except (OSError, StoreError) as error:
                waiting += 1
                log.info("%s is not sent: %s", file, reason_of(error))
        self.waiting = _waiting_sentence(waiting, self._objects.place) if waiting else ""
        return sent

    def _is_settled(self, path: Path) -> bool:
        """Looked at a while ago, and not changed since."""
        try:
            about = path.stat()
        except OSError:
            return True
        known, at = self._settled.get(path, (None, 0.0))
        return known == (about.st_size, about.st_mtime_ns) and time.monotonic() - at < LOOK_AGAIN_AFTER_S

    def _settle(
        self,
        objects: ObjectBlobs,
        path: Path,
        file: str,
        row: SharedFile | None,
        is_whole: Callable[[Path], bool],
    ) -> bool:
        """Whether it was sent."""
        before = path.stat()
        if row is not None and not _is_newer(path, row):
            is_gone = row.sha256 is None or not (_is_same(path, row) or _sha256(path) == row.sha256)
            if is_gone:  # or another service has a newer one
                path.unlink()
                return False
        if row is None or not _is_same(path, row) or _is_newer(path, row):
            if not is_whole(path):
                return False
            digest = _sha256(path)
            objects.send_file(_KEY + file, path)
            about = path.stat()
            if (before.st_size, before.st_mtime_ns) != (about.st_size, about.st_mtime_ns):
                return False  # was replaced meanwhile: the next time
            written_at = datetime.fromtimestamp(about.st_mtime, UTC)
            with self._database.write() as connection:
                now_there = _select(connection, file)
                if now_there is None or now_there == row or _is_newer(path, now_there):
                    _put(connection, SharedFile(file, digest, about.st_size, written_at))
                    now_there = None
            if now_there is not None:  # was erased or replaced meanwhile: the next time
                objects.remove(_KEY + file)
                return False
        self._settled[path] = (before.st_size, before.st_mtime_ns), time.monotonic()
        return True

    def _fetched(self, objects: ObjectBlobs, row: SharedFile) -> Path:
        def check(path: Path) -> None:
            if _sha256(path) != row.sha256:
                raise DamagedArtifact(
                    f"{row.file} in {objects.place} is not what was written; restore it from a backup"
                )

        cached = objects.cached_file(_KEY + row.file)
        if not _is_same(cached, row) or self._fetched_as.get(row.file) != row.sha256:
            objects.fetch_file(_KEY + row.file, check)
            self._fetched_as[row.file] = str(row.sha256)
        return cached

    def _row(self, file: str) -> SharedFile | None:
        with self._database.read() as connection:
            return _select(connection, file)

    def _rows(self, begin: str) -> list[SharedFile]:
        """But for damaged ones, which the search for damage names."""
        table = tables.shared_files
        like = table.c.file.like(_LIKE.sub(r"\\\1", begin) + "%", escape="\\")
        with self._database.read() as connection:
            rows = connection.execute(select(table).where(like).order_by(table.c.file))
            return sort_out(table, rows, lambda values: SharedFile(**values))[0]


def _select(connection: Connection, file: str) -> SharedFile | None:
    """Raises StoreDamaged."""
    table = tables.shared_files
    row = connection.execute(select(table).where(table.c.file == file)).one_or_none()
    return None if row is None else SharedFile(**sound_row(table, row))


def _waiting_sentence(files: int, place: str) -> str:
    return (
        f"{counted(files, 'file')} of the data folder not sent yet to {place}: other services cannot read "
        "them until it has room and answers"
    )


def _put(connection: Connection, row: SharedFile) -> None:
    table = tables.shared_files
    connection.execute(delete(table).where(table.c.file == row.file))
    add_row(connection, table, vars(row))


def _is_newer(path: Path, row: SharedFile) -> bool:
    try:
        return datetime.fromtimestamp(path.stat().st_mtime, UTC) > row.changed_at
    except OSError:
        return False


def _is_same(path: Path, row: SharedFile) -> bool:
    try:
        return path.stat().st_size == row.size_bytes
    except OSError:
        return False


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with open_kept(path) as file:
        while part := file.read(1 << 20):
            digest.update(part)
    return digest.hexdigest()
