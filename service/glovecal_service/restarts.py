"""How often real time was started again: written by the process that supervises it, told by ``/ready``.

A file in the data folder, one wall-clock time a line; real time that dies and is back within a second looks
alive to whoever looks once.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

FILE = "realtime.restarts"
MOST_KEPT = 100
TOLD_FOR_S = 600.0
AWAY_WITHIN_S, AWAY_TIMES = 60.0, 3
"""So many restarts within a minute are no service: gloves get a part of their poses."""


class Restarts:
    """Of real time, by the data folder's file."""

    def __init__(self, data: Path) -> None:
        self._file = data / FILE

    def forget(self) -> None:
        """A service that begins has restarted nothing yet."""
        with suppress(OSError):
            self._file.unlink()

    def note(self) -> None:
        """Real time ended by itself and is started again."""
        with suppress(OSError):  # a full disk must not keep real time from being started
            lines = [*self._lines()[1 - MOST_KEPT :], repr(time.time())]
            self._file.write_text("\n".join(lines) + "\n", encoding="ascii")

    def within(self, seconds: float) -> int:
        """How many there were in the last ``seconds``."""
        since, count = time.time() - seconds, 0
        for line in self._lines():
            with suppress(ValueError):
                count += float(line) >= since
        return count

    def sentence(self) -> str:
        """What to tell; "" where there was none lately."""
        count = self.within(TOLD_FOR_S)
        if not count:
            return ""
        times = "once" if count == 1 else f"{count} times"
        return (
            f"real time ended and was started again {times} in the last {TOLD_FOR_S / 60:.0f} minutes: poses "
            "were missing meanwhile; glovecal serve's log says why"
        )

    def _lines(self) -> list[str]:
        try:
            return self._file.read_text(encoding="ascii", errors="replace").splitlines()
        except OSError:
            return []
