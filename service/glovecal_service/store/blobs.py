"""Artifacts, named by their sha256, and where they lie: a local folder, or an object store (``ObjectBlobs``).

obstore has a local store too, but that one renames without ``fsync`` (seen with strace, version 0.12.1): a
power cut could leave an empty file under the right name. So the folder is written here.
"""

from __future__ import annotations

import errno
import hashlib
import math
import re
import secrets
import shutil
import time
from collections.abc import Hashable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

from glovecal_client.encryption.kept_file import decrypted, encrypted, is_encrypting
from glovecal_client.errors import DamagedFile
from glovecal_client.operating_system import move_over, sync_file
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_service.store.errors import NotFound, StorageFull
from glovecal_service.store.packing import packed, unpacked

TEMPORARY = ".writing-"
ABANDONED_AFTER_S = 600.0
"""A temporary file this old belongs to a process that was killed."""
READ_AGAIN_AFTER_S = 600.0
"""A disk may spoil what nobody wrote."""
LEAST_FREE_BYTES = 50_000_000
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class Blobs(Protocol):
    """Named byte strings, written whole or not at all."""

    @property
    def place(self) -> str:
        """For messages: the folder or URL."""
        ...

    def write(self, name: str, content: bytes) -> None:
        """Replace or create. Raises StorageFull."""
        ...

    def read(self, name: str) -> bytes | None:
        """The content, None if there is none."""
        ...

    def exists(self, name: str) -> bool: ...

    def remove(self, name: str) -> None:
        """Harmless where there is none."""
        ...

    def stamp(self, name: str) -> Hashable | None:
        """Another one once the content was changed; None if there is none."""
        ...


class FolderBlobs:
    """A local folder: temporary file, fsync, rename, fsync of the folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with full_disk_named(folder):
            folder.mkdir(parents=True, exist_ok=True)
        self._sweep()

    @property
    def place(self) -> str:
        return str(self._folder)

    def write(self, name: str, content: bytes) -> None:
        write_durably(self._folder / name, content)

    def read(self, name: str) -> bytes | None:
        try:
            return (self._folder / name).read_bytes()
        except FileNotFoundError:
            return None

    def exists(self, name: str) -> bool:
        return (self._folder / name).is_file()

    def remove(self, name: str) -> None:
        (self._folder / name).unlink(missing_ok=True)

    def stamp(self, name: str) -> Hashable | None:
        try:
            found = (self._folder / name).stat()
        except FileNotFoundError:
            return None
        return found.st_size, found.st_mtime_ns, found.st_ino

    def _sweep(self) -> None:
        for leftover in self._folder.glob(f"{TEMPORARY}*"):
            with suppress(OSError):
                if time.time() - leftover.stat().st_mtime > ABANDONED_AFTER_S:
                    leftover.unlink()


def write_durably(path: Path, content: bytes) -> None:
    """Write ``content`` so that ``path`` holds all of it or is untouched, also after a power cut.

    Raises StorageFull; then nothing is left behind.
    """
    temporary = path.parent / f"{TEMPORARY}{secrets.token_hex(8)}"
    with full_disk_named(path.parent):
        try:
            with temporary.open("xb") as file:
                file.write(content)
                file.flush()
                sync_file(file)
            move_over(temporary, path, durably=True)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def require_room(folder: Path) -> None:
    """Raises StorageFull where the disk is nearly full: what recordings and the database need is left."""
    free = shutil.disk_usage(folder).free
    if free < LEAST_FREE_BYTES:
        raise StorageFull(
            f"only {free / 1e6:.0f} MB are free in {folder}; nothing was changed: free some disk space"
        )


@contextmanager
def full_disk_named(folder: Path) -> Iterator[None]:
    """Turn "no space left" into StorageFull."""
    try:
        yield
    except OSError as error:
        if error.errno not in _NO_ROOM:
            raise
        raise StorageFull(f"no room left in {folder}; nothing was changed: free some disk space") from error


SHA256_NAME = re.compile(r"[0-9a-f]{64}\Z")


class Artifacts:
    """Immutable files in a folder or an object store, named by the sha256 of what they hold, packed and
    encrypted or not."""

    def __init__(self, blobs: Blobs) -> None:
        self._blobs = blobs
        self._verified: dict[str, tuple[Hashable, float]] = {}
        """Stamp and moment of what was read and found sound."""

    def put(self, content: bytes) -> str:
        """Keep ``content`` and return its sha256; once this returns it survives a power cut.

        A file of that name that is damaged, or plain where there is a key, is replaced. Raises StorageFull.
        """
        name = hashlib.sha256(content).hexdigest()
        kept = self._blobs.read(name)
        is_sound = kept is not None and self._content(name, kept) == content
        if not is_sound or (is_encrypting() and unpacked(kept or b"") == content):
            self._blobs.write(name, encrypted(packed(content)))
        return name

    def get(self, sha256: str) -> bytes:
        """The bytes of that name, verified. Raises NotFound, DamagedArtifact."""
        kept = self._blobs.read(check_sha256(sha256))
        if kept is None:
            raise NotFound(
                f"artifact {sha256} is missing from {self._blobs.place}; restore that file from a backup"
            )
        content = self._content(sha256, kept)
        found = hashlib.sha256(content).hexdigest()
        if found != sha256:
            raise DamagedArtifact(
                f"artifact {sha256} in {self._blobs.place} is damaged: its {len(content)} bytes have the"
                f" sha256 {found}; restore that file from a backup"
            )
        return content

    def get_kept(self, sha256: str) -> bytes | None:
        """As it lies there, encrypted or not; None where there is none. Raises OSError, StoreUnavailable."""
        return self._blobs.read(check_sha256(sha256))

    def put_kept(self, sha256: str, kept: bytes) -> None:
        """What ``get_kept`` gave of another store. Raises StorageFull, StoreUnavailable."""
        self._blobs.write(check_sha256(sha256), kept)

    def _content(self, sha256: str, kept: bytes) -> bytes:
        """What was changed comes as it lies there, and has another sha256."""
        try:
            return unpacked(decrypted(kept, f"artifact {sha256}"))
        except DamagedFile:
            return kept

    def verify(self, sha256: str) -> None:
        """As ``get``, without reading again what was sound some minutes ago and is not changed since."""
        stamp, now = self._blobs.stamp(check_sha256(sha256)), time.monotonic()
        before, at = self._verified.get(sha256, (None, -math.inf))
        if stamp is None or stamp != before or now - at > READ_AGAIN_AFTER_S:
            self._verified.pop(sha256, None)
            self.get(sha256)
            self._verified[sha256] = stamp, now

    def remove(self, sha256: str) -> None:
        """Of nobody any more; harmless where it is not there. Raises OSError, StoreUnavailable."""
        self._verified.pop(check_sha256(sha256), None)
        self._blobs.remove(sha256)

    def is_sound(self, sha256: str) -> bool:
        """Whether there is a file of that name that holds what was put there, as ``verify`` finds it."""
        try:
            self.verify(sha256)
        except (NotFound, DamagedArtifact):
            return False
        return True

    def exists(self, sha256: str) -> bool:
        """Whether there is a file of that name, damaged or not."""
        return self._blobs.exists(check_sha256(sha256))


def check_sha256(name: str) -> str:
    """Return ``name`` or raise BadInput: only names of this form ever reach a path."""
    if not SHA256_NAME.match(name):
        raise BadInput(f"{name!r} is not a sha256: 64 digits of 0-9 and a-f")
    return name
