"""Uploads: the bytes as they came, kept under their sha256 before anyone tries to read them."""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from starlette.concurrency import run_in_threadpool

from glovecal_client.encryption.kept_file import create_whole, finish_file, is_kept_encrypted, open_kept
from glovecal_client.operating_system import move_over, name_for_a_file
from glovecal_service.operating_system import memory_file, path_of
from glovecal_service.store.blobs import full_disk_named, require_room
from glovecal_service.store.shared_files import SharedFiles

TEMPORARY = ".partial"
WRITE_AT_ONCE = 2**20
ABANDONED_AFTER_S = 3600.0
"""A temporary file this old belongs to a process that was killed; younger ones may be another's."""


@dataclass(frozen=True)
class Upload:
    """A file that was received whole."""

    path: Path
    sha256: str
    size: int
    is_new: bool
    """False when the same bytes were here before."""


class UploadFolder:
    """``uploads/`` in the data folder, and what other services have of it. Only complete files carry a sha256
    name."""

    def __init__(self, files: SharedFiles) -> None:
        self._files = files
        self.folder = folder = files.data / "uploads"
        folder.mkdir(parents=True, exist_ok=True)

    def sweep(self) -> int:
        """Remove what a killed process left half received; call before the first upload."""
        swept = 0
        for leftover in self.folder.glob(f"*{TEMPORARY}"):
            with suppress(OSError):
                if time.time() - leftover.stat().st_mtime > ABANDONED_AFTER_S:
                    shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink()
                    swept += 1
        return swept

    async def receive(self, chunks: AsyncIterator[bytes]) -> Upload:
        """Write ``chunks`` to a temporary file, force it to disk and give it its sha256 as name.

        Raises StorageFull, and whatever ``chunks`` raises; either way nothing
        is left behind. Memory used is ``WRITE_AT_ONCE`` and one chunk, whatever the size.
        """
        require_room(self.folder)
        temporary = self.folder / f"{secrets.token_hex(16)}{TEMPORARY}"
        try:
            with full_disk_named(self.folder):
                digest, size = await _write(temporary, chunks)
                return await run_in_threadpool(self._keep, temporary, digest, size)
        finally:
            temporary.unlink(missing_ok=True)

    def find(self, sha256: str) -> Path | None:
        """The upload of that name, or None; ``open_kept`` reads it. ``sha256`` must be 64 hex digits
        already. Raises as ``SharedFiles.find``."""
        return self._files.find(f"uploads/{sha256}")

    @contextmanager
    def under_names(self, *files: tuple[str, Path]) -> Iterator[list[Path]]:
        """The uploads under the names their users gave them, for as long as they are being read.

        Readers name the file in their errors. Each of ``files`` is a checked file name and an upload. One
        that is encrypted is decrypted into memory; where the system has no files there, onto the disk.
        """
        with (
            tempfile.TemporaryDirectory(dir=self.folder, suffix=TEMPORARY) as folder,
            ExitStack() as held,
        ):
            named = []
            for number, (name, upload) in enumerate(files):
                place = Path(folder) / str(number)
                place.mkdir()
                named.append(place / name_for_a_file(name))
                if is_kept_encrypted(upload):
                    _decrypt(upload, named[-1], held)
                else:
                    _link(upload, named[-1])
            yield named

    def _keep(self, temporary: Path, digest: str, size: int) -> Upload:
        path = self.folder / digest
        is_new = not path.exists()
        move_over(temporary, path, durably=True)  # also over an earlier one: that may have been damaged since
        self._files.note_written(f"uploads/{digest}")
        return Upload(path, digest, size, is_new)


async def _write(path: Path, chunks: AsyncIterator[bytes]) -> tuple[str, int]:
    digest, size, waiting = hashlib.sha256(), 0, bytearray()
    with create_whole(path) as file:

        def write() -> None:
            digest.update(waiting)
            file.write(waiting)

        def finish() -> None:
            write()
            finish_file(file)

        async for chunk in chunks:
            waiting += chunk
            size += len(chunk)
            if len(waiting) >= WRITE_AT_ONCE:
                await run_in_threadpool(write)
                waiting.clear()
        await run_in_threadpool(finish)
    return digest.hexdigest(), size


def _decrypt(source: Path, name: Path, held: ExitStack) -> None:
    file = memory_file()
    with open_kept(source) as encrypted:
        if file is None:
            with name.open("xb") as plain:
                shutil.copyfileobj(encrypted, plain)
        else:
            held.enter_context(file)
            shutil.copyfileobj(encrypted, file)
            file.flush()
            name.symlink_to(path_of(file))


def _link(source: Path, name: Path) -> None:
    try:
        os.link(source, name)
    except OSError:  # a file system without hard links
        shutil.copyfile(source, name)
