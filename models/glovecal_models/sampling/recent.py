"""The frames that the protocol has in memory: the last moment, and those of the running step."""

from __future__ import annotations

from collections import deque

from glovecal_models.sampling.reading import GloveReading
from glovecal_models.sampling.steadiness import BLOCK_S, ActiveRanges, moved_percent

KEPT_S = 1.2


class RecentReadings:
    def __init__(self) -> None:
        self._last: deque[GloveReading] = deque()
        self.kept: list[GloveReading] = []
        """Of the running step."""
        self.keeps = False
        self.moved = False
        """Whether the hand moved since ``forget_motion``."""

    @property
    def newest(self) -> GloveReading | None:
        return self._last[-1] if self._last else None

    def add(self, reading: GloveReading) -> bool:
        """Whether it is one: of this many sensors, and later than the one before."""
        last = self.newest
        if last is not None and last.run != reading.run:
            self._last.clear()
        elif last is not None and reading.time_s <= last.time_s:
            return False
        self._last.append(reading)
        while reading.time_s - self._last[0].time_s > KEPT_S:
            self._last.popleft()
        if self.keeps:
            self.kept.append(reading)
        return True

    def begin(self) -> None:
        self.kept, self.keeps = [], True

    def end(self) -> list[GloveReading]:
        kept, self.kept, self.keeps = self.kept, [], False
        return kept

    def forget(self) -> None:
        self._last.clear()
        self.end()

    def percent(self, seconds: float, ranges: ActiveRanges) -> float | None:
        """How far the most moving sensor went in the last ``seconds``; None before there are so many."""
        last = self.newest
        if last is None or last.time_s - self._last[0].time_s < seconds - BLOCK_S:
            return None
        window = [reading for reading in self._last if reading.time_s > last.time_s - seconds]
        return float(moved_percent(window, ranges).max())
