"""How long a job will still take, from its own speed so far."""

from __future__ import annotations

import time
from collections.abc import Callable

LEAST_S = 1.0
LEAST_SHARE = 0.02
"""Sooner than this the speed is that of a few steps."""


class TimeLeft:
    """Counts from the moment it is made, when ``fraction`` of the job was done."""

    def __init__(self, fraction: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._first, self._began = clock, fraction, clock()

    def seconds(self, fraction: float) -> float | None:
        """None while there is no speed yet to tell from."""
        took, done = self._clock() - self._began, fraction - self._first
        if took < LEAST_S or done < LEAST_SHARE:
            return None
        return took * (1.0 - fraction) / done
