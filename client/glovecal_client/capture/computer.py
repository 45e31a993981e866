"""Which computer's monotonic clock times are of: equal for all programs of one computer until it restarts."""

from __future__ import annotations

import hashlib
import socket
import time
from functools import cache
from pathlib import Path

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_ROUNDED_S = 60.0


@cache
def computer_id() -> str:
    """16 hexadecimal digits, of which nothing about the computer can be read.

    Linux names each boot; elsewhere it is the computer's name and the minute in which it started.
    """
    try:
        text = _BOOT_ID.read_text(encoding="ascii")
    except OSError:
        booted = round((time.time() - time.monotonic()) / _ROUNDED_S)
        text = f"{socket.gethostname()} {booted}"
    return hashlib.sha256(f"glovecal {text}".encode()).hexdigest()[:16]
