"""Results of finished tasks on disk, by task key: what was computed once is not computed again."""

from __future__ import annotations

import hashlib
import os
import re
from contextlib import suppress
from pathlib import Path

from safetensors import SafetensorError

from glovecal_client.encryption.kept_file import encrypted, read_kept
from glovecal_client.operating_system import remove
from glovecal_models.errors import BadInput
from glovecal_service.jobs.job_kind import TaskResult
from glovecal_service.store.blobs import write_durably

KEPT_BYTES = 2_000_000_000
_KEY = re.compile(r"[0-9a-f]{16,128}\Z")


class FinishedTasks:
    """Files ``<key>.<sha256 of the content>.safetensors``; a file that does not match its name is ignored."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get(self, key: str) -> TaskResult | None:
        """The result of that key, None if there is none or it is damaged."""
        for path in self.folder.glob(f"{_check(key)}.*.safetensors"):
            with suppress(OSError, SafetensorError, KeyError, ValueError):
                content = read_kept(path)
                if hashlib.sha256(content).hexdigest() == path.name.split(".")[1]:
                    os.utime(path)
                    return TaskResult.from_bytes(content)
            remove(path)
        return None

    def put(self, key: str, result: TaskResult) -> None:
        """Keep a result. Raises StorageFull."""
        content = result.to_bytes()
        digest = hashlib.sha256(content).hexdigest()
        write_durably(self.folder / f"{_check(key)}.{digest}.safetensors", encrypted(content))

    def prune(self, kept_bytes: int = KEPT_BYTES) -> None:
        """Delete the results that were not used for longest until the rest fits."""
        used = []
        for path in self.folder.glob("*.safetensors"):
            with suppress(FileNotFoundError):
                used.append((path.stat().st_mtime, path.stat().st_size, path))
        total = 0
        for _, size, path in sorted(used, reverse=True):
            total += size
            if total > kept_bytes:
                remove(path)


def _check(key: str) -> str:
    if not _KEY.match(key):
        raise BadInput(f"{key!r} is no task key: 16 to 128 hexadecimal digits")
    return key
