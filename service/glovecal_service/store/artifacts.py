"""Bytes named by their sha256: what is read is what was written, or DamagedArtifact names the file."""

from __future__ import annotations

import hashlib
import re

from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_service.store.blobs import Blobs
from glovecal_service.store.errors import NotFound

SHA256_NAME = re.compile(r"[0-9a-f]{64}\Z")


class Artifacts:
    """Immutable files in a folder or an object store."""

    def __init__(self, blobs: Blobs) -> None:
        self._blobs = blobs

    def put(self, content: bytes) -> str:
        """Keep ``content`` and return its sha256; once this returns it survives a power cut.

        A file of that name that is damaged is replaced. Raises StorageFull.
        """
        name = hashlib.sha256(content).hexdigest()
        if self._blobs.read(name) != content:
            self._blobs.write(name, content)
        return name

    def get(self, sha256: str) -> bytes:
        """The bytes of that name, verified. Raises NotFound, DamagedArtifact."""
        content = self._blobs.read(check_sha256(sha256))
        if content is None:
            raise NotFound(
                f"artifact {sha256} is missing from {self._blobs.place}; restore that file from a backup"
            )
        found = hashlib.sha256(content).hexdigest()
        if found != sha256:
            raise DamagedArtifact(
                f"artifact {sha256} in {self._blobs.place} is damaged: its {len(content)} bytes have the"
                f" sha256 {found}; restore that file from a backup"
            )
        return content

    def is_sound(self, sha256: str) -> bool:
        """Whether there is a file of that name that holds what was put there."""
        try:
            self.get(sha256)
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
