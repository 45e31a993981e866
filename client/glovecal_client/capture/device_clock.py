"""A glove's own time stamps as times of the capture computer.

Gloves count ticks that wrap: a CyberGlove box 115200 a second in 32 bits (10.36 hours). A record is never
seen before it was taken, and the one that travelled fastest tells best how the two clocks stand; so the
smallest difference seen, allowed to grow slowly for two quartzes that drift apart, maps one clock to the
other and takes the jitter of the serial adapter out of the times.
"""

from __future__ import annotations

_DRIFT = 200e-6
"""How fast the difference may grow, s per s: two cheap quartzes of 100 ppm each."""
_RESTARTED_S = 1.0
"""A stamp this far off its expected time means that the glove's clock began anew or was set."""


class DeviceClock:
    """Maps tick counts to monotonic nanoseconds, strictly growing and never later than the arrival."""

    def __init__(self, ticks_per_second: float, wrap: float = 1 << 32) -> None:
        """``wrap``: the count after which the stamp begins at 0 again."""
        self._tick_ns = 1e9 / ticks_per_second
        self._wrap = wrap
        self._last_ticks: float | None = None
        self._elapsed_ticks = 0.0
        self._difference_ns = 0.0
        self._last_arrival_ns = 0
        self._last_given_ns = 0

    def monotonic_ns(self, ticks: float, arrival_ns: int) -> int:
        """The computer's monotonic time of a record stamped ``ticks`` that came at ``arrival_ns``."""
        if self._last_ticks is None:
            self._begin(ticks, arrival_ns)
        else:
            self._elapsed_ticks += (ticks - self._last_ticks) % self._wrap
            waited_ns = arrival_ns - self._last_arrival_ns
            difference = arrival_ns - self._device_ns()
            if abs(difference - self._difference_ns) > _RESTARTED_S * 1e9:
                self._begin(ticks, arrival_ns)
            else:
                self._difference_ns = min(difference, self._difference_ns + _DRIFT * waited_ns)
        self._last_ticks = ticks
        self._last_arrival_ns = arrival_ns
        given = int(self._device_ns() + self._difference_ns)
        self._last_given_ns = max(self._last_given_ns + 1, min(given, arrival_ns))
        return self._last_given_ns

    def _device_ns(self) -> float:
        return self._elapsed_ticks * self._tick_ns

    def _begin(self, ticks: float, arrival_ns: int) -> None:
        self._elapsed_ticks = 0.0
        self._difference_ns = float(arrival_ns)
