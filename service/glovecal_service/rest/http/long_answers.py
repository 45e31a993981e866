"""Answers that may take longer than a second: worked out in a process of their own, which ends with them.

Meanwhile the web process answers others and keeps none of their memory. The process is ended when nobody
waits for the answer any more, and when its time is over.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

import anyio.to_thread
from fastapi import Request
from starlette.requests import ClientDisconnect

from glovecal_models.errors import Cancelled
from glovecal_models.progress import Cancel
from glovecal_models.worker_processes import work_off
from glovecal_service.rest.http.dependencies import Parts
from glovecal_service.rest.http.problem import Problem

Result = TypeVar("Result")
LOOK_EVERY_S = 0.5
A_PROCESS = 2
"""Workers, of which one task uses one; with a single one ``work_off`` would stay in this process."""


async def in_time(
    request: Request, parts: Parts, compute: Callable[[Cancel], Result], *, limit_s: float, what: str
) -> Result:
    """What ``compute`` gives, in a thread; it is told to stop by its argument, and raises Cancelled then.

    ``LONG_ANSWERS_AT_ONCE`` at once, the others wait. Raises Problem 422 when ``limit_s`` are over.
    """
    gone = threading.Event()
    until: list[float] = []

    def cancelled() -> bool:
        return gone.is_set() or time.monotonic() > until[0]

    def run() -> Result:
        until.append(time.monotonic() + limit_s)
        return compute(cancelled)

    watch = asyncio.ensure_future(_set_when_gone(request, gone))
    try:
        return await anyio.to_thread.run_sync(run, limiter=parts.answer_slots)
    except Cancelled as error:
        if gone.is_set():
            raise ClientDisconnect from error
        raise Problem(
            422,
            "takes-too-long",
            f"{what} takes longer than {limit_s:g} s; ask for less, such as fewer or shorter takes",
        ) from error
    finally:
        watch.cancel()
        with suppress(asyncio.CancelledError):
            await watch


def in_process(work: Callable[[Any], Result], task: Any, what: str, cancelled: Cancel) -> Result:
    """``work`` of a task, in a process of its own. Raises Cancelled, WorkerDied, and what ``work`` raises."""
    found: list[Result] = []
    work_off(work, [task], A_PROCESS, lambda _, result: found.append(result), what, cancelled)
    return found[0]


async def _set_when_gone(request: Request, gone: threading.Event) -> None:
    while not await request.is_disconnected():
        await asyncio.sleep(LOOK_EVERY_S)
    gone.set()
