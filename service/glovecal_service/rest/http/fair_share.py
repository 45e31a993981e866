"""What one key or person may ask for, so that the others are answered too."""

from __future__ import annotations

import re
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import anyio

from glovecal_service.rest.http.pauses import Pauses, too_early

MOST_HZ, BURST = 100.0, 500
"""Requests a second, and together before that counts: a page of the studio loads some fifty files."""
MOST_AT_ONCE = 16
"""Requests that are answered at the same time; more of the same key or person wait for these."""
_STAYS_OPEN = re.compile(r".*/events")
"""Answers that go on until somebody leaves."""


class FairShare:
    """For the event loop's thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._paces = Pauses(1.0 / MOST_HZ, BURST, clock)
        self._turns: dict[str, anyio.CapacityLimiter] = {}
        """By names of the store, of which there are few."""

    @asynccontextmanager
    async def turn(self, who: str, path: str) -> AsyncIterator[None]:
        """To answer one request. Raises Problem 429 where there were too many."""
        if (wait_s := self._paces.wait_s(who)) > 0.0:
            raise too_early(
                wait_s,
                "too-many-requests",
                f"{who} asks more than {MOST_HZ:g} times a second; ask again in {{seconds}} s, and less "
                "often.",
            )
        self._paces.count(who)
        if _STAYS_OPEN.fullmatch(path):
            yield
            return
        async with self._turns.setdefault(who, anyio.CapacityLimiter(MOST_AT_ONCE)):
            yield
