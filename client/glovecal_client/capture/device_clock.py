"""Times of a glove's readings on the capture computer's clock, with and without a clock in the glove.

Gloves count ticks that wrap: a CyberGlove box 115200 a second in 32 bits (10.36 hours). A record is never
seen before it was taken, and the one that travelled fastest tells best how the two clocks stand; so the
smallest difference seen, allowed to grow slowly for two quartzes that drift apart, maps one clock to the
other and takes the jitter of the serial adapter out of the times.

How the two clocks stand is measured while the glove streams. Krnoul et al. 2016 (section 3.1) set two gloves
to one time until they differ by less than a frame of 1/30 s, and know no more. Here every stamp counts: of
each two seconds the record that travelled fastest is kept, and a line through those tells offset and drift.

Where a glove has no clock, adapters and networks hand several records over at once.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

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


BLOCK_S = 2.0
MOST_BLOCKS = 4096
"""Two hours of them; then every second one goes and blocks count double."""
RESTARTED_S = 1.0
"""A stamp this far off means that the clock was set or began anew: the line starts again."""


@dataclass(frozen=True)
class ClockLine:
    """``own = own_s + (1 + drift) * (monotonic - at_s)``, times in seconds."""

    at_s: float
    """The capture computer's monotonic clock, in the middle of what was measured."""
    own_s: float
    drift: float
    """What the glove's clock gains, s per s."""
    sd_s: float
    """Standard deviation of ``own_s``; the shortest delay of a record is not in it, it cannot be seen."""
    drift_sd: float
    span_s: float
    blocks: int

    def own(self, monotonic_s: np.ndarray | float) -> np.ndarray | float:
        """The glove's clock at a time of the computer's."""
        return self.own_s + (1 + self.drift) * (monotonic_s - self.at_s)

    def monotonic(self, own_s: np.ndarray | float) -> np.ndarray | float:
        """The computer's time of a stamp of the glove."""
        return self.at_s + (own_s - self.own_s) / (1 + self.drift)

    def document(self) -> dict[str, Any]:
        """As the capture daemon's status and a take's accounting hold it."""
        return {
            "at_monotonic_s": round(self.at_s, 6),
            "own_s": round(self.own_s, 6),
            "drift_ppm": round(1e6 * self.drift, 3),
            "sd_s": round(self.sd_s, 6),
            "drift_sd_ppm": round(1e6 * self.drift_sd, 3),
            "span_s": round(self.span_s, 1),
        }


class OwnClock:
    """Takes every record's ticks and arrival; costs a comparison a record and a fit each two seconds."""

    def __init__(self, ticks_per_second: float, wrap: int) -> None:
        """``wrap``: the count after which the stamp begins at 0 again."""
        self._tick_s, self._wrap = 1.0 / ticks_per_second, wrap
        self.line: ClockLine | None = None
        """None before the first block is full."""
        self._last_ticks: float | None = None
        self._ticks = 0.0
        self._begin()

    def note(self, ticks: float, arrival_ns: int) -> None:
        """A record stamped ``ticks`` arrived."""
        if self._last_ticks is None:
            self._ticks = ticks
        else:
            self._ticks += (ticks - self._last_ticks) % self._wrap
        self._last_ticks = ticks
        arrival_s = arrival_ns / 1e9
        late_s = arrival_s - self._ticks * self._tick_s
        if self._least is None:
            self._least, self._block_ends_s = (arrival_s, late_s), arrival_s + self._block_s
            return
        if abs(late_s - self._least[1]) > RESTARTED_S:
            self._ticks = ticks
            self._begin()
            self._least = arrival_s, arrival_s - ticks * self._tick_s
            self._block_ends_s = arrival_s + self._block_s
        elif arrival_s >= self._block_ends_s:
            self._end_block()
            self._least, self._block_ends_s = (arrival_s, late_s), arrival_s + self._block_s
        elif late_s < self._least[1]:
            self._least = arrival_s, late_s

    def _begin(self) -> None:
        self._block_s = BLOCK_S
        self._blocks: list[tuple[float, float]] = []
        self._least: tuple[float, float] | None = None
        self._block_ends_s = 0.0
        self.line = None

    def _end_block(self) -> None:
        if self._least is not None:
            self._blocks.append(self._least)
        if len(self._blocks) >= MOST_BLOCKS:
            self._blocks, self._block_s = self._blocks[::2], 2 * self._block_s
        self.line = line_through(np.array(self._blocks), 1e-3 if len(self._blocks) < 3 else 0.0)


def line_through(points: np.ndarray, least_sd_s: float = 0.0) -> ClockLine:
    """Least squares over ``points`` (K, 2): monotonic time, and how much later it is than the own clock.

    One point gives no drift: that is 0 with a standard deviation of 100 ppm, a cheap quartz.
    """
    time_s, late_s = points[:, 0], points[:, 1]
    at_s, middle = float(time_s.mean()), float(late_s.mean())
    centred = time_s - at_s
    spread, count = float(np.sum(centred**2)), len(points)
    slope = float(centred @ (late_s - middle)) / spread if count > 1 else 0.0
    left = late_s - middle - slope * centred
    scatter = float(np.sqrt(np.sum(left**2) / (count - 2))) if count > 2 else least_sd_s
    scatter = max(scatter, least_sd_s)
    return ClockLine(
        at_s=at_s, own_s=at_s - middle, drift=-slope, sd_s=scatter / np.sqrt(count),
        drift_sd=scatter / np.sqrt(spread) if count > 1 else 100e-6,
        span_s=float(time_s[-1] - time_s[0]), blocks=count,
    )  # fmt: skip


_BLOCKS = 64
_FEWEST_RECORDS = 8
_PAUSE_PERIODS = 20
"""A wait of so many records is a pause: it says nothing of the rate."""


class ArrivalTimes:
    """Spreads records that came together, by the period measured over the arrivals before.

    No record is dated before the one that came before it, and the last of each arrival has the time of the
    arrival. Gloves send at their own rate: the period comes from what arrived, never from a nominal rate.
    """

    def __init__(self, nominal_hz: float) -> None:
        """``nominal_hz`` serves the records of the first arrivals only."""
        self._period_ns = 1e9 / nominal_hz
        self._counts: deque[tuple[int, int]] = deque(maxlen=_BLOCKS)
        """Arrival in ns and records come until then."""
        self._records = 0
        self._last_ns: int | None = None

    @property
    def period_ns(self) -> float:
        """The time between two records: as measured, nominal before that."""
        return self._period_ns

    def of(self, count: int, now_ns: int) -> list[int]:
        """The times of ``count`` records that arrived at ``now_ns``, oldest first, strictly growing."""
        if count == 0:
            return []
        self._measure(count, now_ns)
        step_ns = self._period_ns
        if self._last_ns is not None:
            step_ns = min(step_ns, (now_ns - self._last_ns) / count)
        times = []
        for behind in range(count - 1, -1, -1):
            time_ns = now_ns - round(behind * step_ns)
            self._last_ns = time_ns if self._last_ns is None else max(time_ns, self._last_ns + 1)
            times.append(self._last_ns)
        return times

    def _measure(self, count: int, now_ns: int) -> None:
        if self._counts and now_ns - self._counts[-1][0] > _PAUSE_PERIODS * self._period_ns * count:
            self._counts.clear()
        self._records += count
        self._counts.append((now_ns, self._records))
        first_ns, first_count = self._counts[0]
        if self._records - first_count >= _FEWEST_RECORDS and now_ns > first_ns:
            self._period_ns = (now_ns - first_ns) / (self._records - first_count)
