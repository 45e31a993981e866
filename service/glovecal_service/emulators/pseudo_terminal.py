"""A serial port that is not there: what emulated gloves need of the operating system, which Windows has not.

Drivers and emulators share no code, so this stands beside ``glovecal_service.operating_system``.
"""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

from glovecal_models.errors import BadInput

_HAS_TERMINALS = sys.platform != "win32"


class PseudoTerminal:
    """A serial port under the name ``link``, a symbolic link that outlives re-plugging. POSIX only."""

    def __init__(self, link: Path) -> None:
        """Raises BadInput where the name is taken, or where there are no pseudo-terminals."""
        if not _HAS_TERMINALS:
            raise BadInput("this computer has no pseudo-terminals; use --tcp or --udp")
        if link.exists() or link.is_symlink():
            raise BadInput(f"{link} exists already: another emulator, or name a new port with --port")
        self.name = str(link)
        self._link = link
        self._ends: tuple[int, int] | None = None

    def plug(self) -> None:
        if self._ends is None:
            self._ends, path = _opened()
            self._link.symlink_to(path)

    def unplug(self) -> None:
        """The port vanishes: whoever has it open gets an error."""
        if self._ends is not None:
            self._link.unlink(missing_ok=True)
            for end in self._ends:
                os.close(end)
            self._ends = None

    def handle(self) -> int | None:
        return self._ends[0] if self._ends else None

    def read(self) -> bytes:
        with contextlib.suppress(OSError):
            return os.read(self._ends[0], 4096) if self._ends else b""
        return b""

    def write(self, data: bytes) -> bool:
        """What does not fit is lost, as in a serial port that nobody reads."""
        if self._ends is None:
            return False
        with contextlib.suppress(OSError):
            return os.write(self._ends[0], data) == len(data)
        return False


def _opened() -> tuple[tuple[int, int], str]:
    """Our end, which never blocks, the glove's, and the path of that."""
    assert sys.platform != "win32"
    import tty

    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    return (ours, theirs), os.ttyname(theirs)
