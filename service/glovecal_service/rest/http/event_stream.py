"""Server-sent events: the store is looked at again and again, also after it did not answer."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import TypeVar

from glovecal_service.store.errors import StoreUnavailable

Result = TypeVar("Result")
LONGEST_STREAM_S = 3600.0
"""After this a stream ends without its last event; listeners connect again with ``Last-Event-ID``."""


async def looks(read: Callable[[], Result], every_s: float) -> AsyncIterator[Result]:
    """What ``read`` gives each time, but where it raises StoreUnavailable."""
    until = time.monotonic() + LONGEST_STREAM_S
    while time.monotonic() < until:
        found: list[Result] = []
        with suppress(StoreUnavailable):
            found.append(await asyncio.to_thread(read))
        for each in found:
            yield each
        await asyncio.sleep(every_s)
