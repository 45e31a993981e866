"""How a glove's own clock stands against the computer's, measured from its stamps while it streams.

Krnoul et al. 2016 (section 3.1) set two gloves to one time until they differ by less than a frame of 1/30 s,
and know no more. Here every stamp counts: a record is never seen before it was taken, so of each two seconds
the one that travelled fastest is kept, and a line through those tells offset and drift.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

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
