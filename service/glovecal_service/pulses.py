"""Signs of life: each process that ``serve`` supervises touches a file of its own in the data folder.

A supervisor sees that a process has ended; who looks here sees one that stands still too, and asks no
database for it.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from threading import Event

FOLDER = "pulses"
BEAT_EVERY_S = 1.0
SEEN_WITHIN_S = 5.0
"""A process that did not touch its file for so long stands still."""


class Pulses:
    """Of the processes of one service, by a folder in its data folder. On a full disk, too."""

    def __init__(self, data: Path) -> None:
        self._folder = data / FOLDER

    def expect(self, processes: Iterable[str]) -> None:
        """A service begins, with these; no others are looked for."""
        with suppress(OSError):  # a full disk: those that come to live are looked for
            self._folder.mkdir(mode=0o700, exist_ok=True)
            for earlier in self._folder.iterdir():
                earlier.unlink(missing_ok=True)
            for process in processes:
                (self._folder / process).touch()

    def beat(self, process: str, stopped: Event) -> None:
        """In a thread of the process, until ``stopped``."""
        while True:
            with suppress(OSError):
                (self._folder / process).touch()
            if stopped.wait(BEAT_EVERY_S):
                return

    def seen_s_ago(self) -> dict[str, float]:
        """Seconds since the last sign, by process; {} where no service was started. No file is read."""
        now, found = time.time(), {}
        with suppress(OSError):
            for file in sorted(self._folder.iterdir()):
                found[file.name] = round(max(0.0, now - file.stat().st_mtime), 1)
        return found


def standing_still(seen_s_ago: dict[str, float]) -> str:
    """Which of them do, and what to do, as a sentence without its end; "" where none does."""
    still = [f"{process} for {ago:.0f} s" for process, ago in seen_s_ago.items() if ago > SEEN_WITHIN_S]
    if not still:
        return ""
    return (
        f"processes of the service give no sign of life ({', '.join(still)}): see glovecal serve's log, and "
        "restart the service if they do not come back"
    )
