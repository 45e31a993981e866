"""One service a data folder: two would carry out the same recordings and jobs, each into the other's files.

The lock goes with the process, also on ``kill -9``. Where processes are forked the children of a killed
supervisor hold it until they have ended too.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO

from glovecal_client.operating_system import lock_file
from glovecal_models.errors import GlovecalError

LOCK, WHO = "service.lock", "service.txt"
"""In the data folder; on Windows nobody else can read what is locked."""
ENDS_WITHIN_S = 3.0
"""Processes of a service that was killed have ended by then."""
_LOOK_EVERY_S = 0.1


class FolderInUse(GlovecalError):
    """Another service runs on the data folder, or it cannot be locked."""


class DataFolderLock:
    """Held from ``with`` on."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file: IO[bytes] | None = None
        self._who = folder / WHO

    def __enter__(self) -> DataFolderLock:
        """Raises FolderInUse."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            file = (self._folder / LOCK).open("ab")
        except OSError as error:
            raise FolderInUse(
                f"the data folder {self._folder.resolve()} cannot be written ({error.strerror}); choose "
                "another with GLOVECAL_DATA"
            ) from error
        until = time.monotonic() + ENDS_WITHIN_S
        while True:
            try:
                lock_file(file)
                break
            except OSError as error:
                if time.monotonic() >= until:
                    file.close()
                    raise FolderInUse(self._told()) from error
                time.sleep(_LOOK_EVERY_S)
        self._file = file
        return self

    def say_who(self, who: str) -> None:
        """What a second service is to say of this one."""
        with suppress(OSError):
            self._who.write_text(who, encoding="utf-8")

    def _told(self) -> str:
        who = "a process that has not said who it is yet"
        with suppress(OSError, ValueError):
            who = self._who.read_text(encoding="utf-8")
        return (
            f"another service runs on the data folder {self._folder.resolve()} ({who}); stop that one, or "
            "choose another folder with GLOVECAL_DATA"
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            with suppress(OSError):
                self._who.unlink(missing_ok=True)
            self._file.close()
            self._file = None
