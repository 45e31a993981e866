"""The search for damage, in pieces between which the service does everything else."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Iterator
from contextlib import suppress

from starlette.concurrency import run_in_threadpool

from glovecal_service.logs import Event
from glovecal_service.store.damages import Damage
from glovecal_service.store.errors import StoreError
from glovecal_service.store.store import Store

FIRST_AFTER_S, EVERY_S, AGAIN_EVERY_S = 60.0, 3600.0, 60.0
SHARE = 0.1
"""Of the time, at most, that is spent searching."""
LEAST_PAUSE_S = 0.02
_log = logging.getLogger("glovecal.rest")


async def search_for_damage(store: Store) -> None:
    """Once an hour, without end; what is known is looked at again each minute."""
    await asyncio.sleep(FIRST_AFTER_S)
    while True:
        next_at = time.monotonic() + EVERY_S
        with suppress(StoreError, OSError):  # another time
            await _search(store)
        while time.monotonic() < next_at:
            await asyncio.sleep(AGAIN_EVERY_S)
            await _look_again(store)


async def _search(store: Store) -> None:
    steps, again_at = store.damages.search(), time.monotonic() + AGAIN_EVERY_S
    while True:
        began = time.monotonic()
        damages = await run_in_threadpool(_next, steps)
        if damages is None:
            return
        for damage in damages:
            event = Event("damage", {"sentence": damage.sentence}, table=damage.table, id=damage.id)
            _log.error("%s", event)
        if time.monotonic() > again_at:
            await _look_again(store)
            again_at = time.monotonic() + AGAIN_EVERY_S
        await asyncio.sleep(max(LEAST_PAUSE_S, (time.monotonic() - began) * (1 / SHARE - 1)))


def _next(steps: Iterator[list[Damage]]) -> list[Damage] | None:
    return next(steps, None)


async def _look_again(store: Store) -> None:
    with suppress(StoreError, OSError):  # another time
        await run_in_threadpool(store.damages.look_again)
