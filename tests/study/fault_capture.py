"""``glovecal capture`` on a computer whose time of day is set while it runs: by the seconds that a file says.

For ``python fault_capture.py FILE ARGUMENTS-OF-CAPTURE``: only this process sees that clock.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path


def set_clock_by(file: Path) -> None:
    """``time.time`` and ``time.time_ns`` follow the file, which is looked at ten times a second."""
    true_time_ns, monotonic_ns = time.time_ns, time.monotonic_ns
    looked_at, ahead_ns = 0, 0

    def time_ns() -> int:
        nonlocal looked_at, ahead_ns
        if monotonic_ns() - looked_at > 100_000_000:
            looked_at, ahead_ns = monotonic_ns(), int(float(file.read_text() or "0") * 1e9)
        return true_time_ns() + ahead_ns

    time.time_ns, time.time = time_ns, lambda: time_ns() / 1e9


if __name__ == "__main__":
    set_clock_by(Path(sys.argv.pop(1)))
    from glovecal_client.capture.command import script

    script()
