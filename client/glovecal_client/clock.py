"""The clocks that stamp frames, pictures and keys: one for all programs of a computer, fine on every system.

``time.monotonic`` and ``time.time`` are not: before Python 3.13 they go on every 15.6 ms on Windows
(GetTickCount64, GetSystemTimeAsFileTime), so that two of three frames of a 120 Hz glove would carry one time.
``time.perf_counter`` is the very clock of ``time.monotonic`` on Linux (CLOCK_MONOTONIC) and macOS
(mach_absolute_time); on Windows it is the performance counter, finer than 1 microsecond, and since Python
3.10 one for the whole system. GetSystemTimePreciseAsFileTime tells Windows' time of day to 100 ns.

``time.monotonic`` is for time limits; its values are never compared with these.

Which computer's monotonic clock times are of: equal for all programs of one computer until it restarts.
"""

from __future__ import annotations

import hashlib
import sys
import time
from functools import cache

from glovecal_client.operating_system import boot

_FROM_1601_TO_1970 = 116_444_736_000_000_000
"""Windows counts units of 100 ns since 1601."""


def clock_ns() -> int:
    """Nanoseconds of the monotonic clock."""
    return time.perf_counter_ns()


def clock_s() -> float:
    """Seconds of the monotonic clock."""
    return time.perf_counter()


def wall_ns() -> int:
    """The time of day, nanoseconds since 1970 (UTC); it may be set and then jumps."""
    if sys.platform == "win32" and sys.version_info < (3, 13):
        import ctypes

        units = ctypes.c_ulonglong()
        ctypes.WinDLL("kernel32").GetSystemTimePreciseAsFileTime(ctypes.byref(units))
        return (units.value - _FROM_1601_TO_1970) * 100
    return time.time_ns()


@cache
def computer_id() -> str:
    """16 hexadecimal digits, of which nothing about the computer can be read."""
    return hashlib.sha256(f"glovecal {boot()}".encode()).hexdigest()[:16]
