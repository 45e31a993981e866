"""Who runs a job: a name, and a lock file that the operating system frees when the process dies.

So a service that starts again after ``kill -9`` takes its jobs back at once instead of after their lease.
"""

from __future__ import annotations

import os
import secrets
import socket
from pathlib import Path
from typing import IO

from glovecal_client.operating_system import lock_file
from glovecal_service.store import Store


class Owner:
    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self.name = f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"
        self._file: IO[bytes] | None = self._path(self.name).open("wb")
        lock_file(self._file)

    def take_back_from_dead(self, store: Store) -> int:
        """Queue the jobs of owners whose lock is free; how many there were."""
        dead = [name for name in store.jobs.owners() if name != self.name and self._is_dead(name)]
        count = sum(store.jobs.requeue_of(name) for name in dead)
        for name in dead:
            self._path(name).unlink(missing_ok=True)
        return count

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
            self._path(self.name).unlink(missing_ok=True)

    def _is_dead(self, name: str) -> bool:
        if self._path(name).parent != self._folder or not self._path(name).is_file():
            return False  # another computer's, or unknown: its lease will tell
        try:
            with self._path(name).open("rb") as file:
                lock_file(file)
        except OSError:
            return False
        return True

    def _path(self, name: str) -> Path:
        return self._folder / f"{name}.lock"
