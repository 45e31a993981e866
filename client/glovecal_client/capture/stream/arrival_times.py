"""Times of records from gloves without a clock: adapters and networks hand several over at once."""

from __future__ import annotations

from collections import deque

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
