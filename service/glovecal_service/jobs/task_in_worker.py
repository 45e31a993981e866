"""A task in a worker process: it arrives as bytes, and what is told of it leaves by the one connection that
the worker has made to the scheduler. The service never connects to a worker, so one may be behind a router,
and shares nothing with it: no folder, no database, no key."""

from __future__ import annotations

import json
import traceback
from collections.abc import Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import Any

from distributed import Reschedule, Worker, get_worker
from distributed.core import Status
from distributed.protocol.pickle import dumps, loads

from glovecal_service.jobs.job_kind import Task
from glovecal_service.jobs.task_run import TaskOutcome, mistake, run_task

OUTCOME, PROGRESS = "glovecal-outcome", "glovecal-progress"
"""Messages from a worker to the scheduler, beside Dask's own."""
TELL_EVERY_S = 0.1
_NOTHING: Mapping[str, Any] = MappingProxyType({})


def packed(task: Task) -> bytes:
    """As ``work_off`` takes it: pickled as Dask would, but here, so that its weight on the way is known and
    what cannot be unpacked is that task's error."""
    return dumps(task)


def work_off(task: bytes) -> None:
    """Run a packed task, called by Dask. Once this returns, its outcome is on the way. Raises Reschedule for
    one that was stopped: if somebody still wants it, then not from a worker that is about to end."""
    worker = get_worker()
    key = str(worker.get_current_task())
    try:
        outcome = run_task(loads(task), lambda: _is_dropped(worker, key), _LastReport(worker, key))
    except Exception as error:  # of unpacking
        outcome = TaskOutcome(error=mistake(error), trace=traceback.format_exc())
    if outcome.cancelled:
        raise Reschedule
    # Dask's own word that the task is over is sent after this, as it too passes through the loop
    worker.loop.add_callback(worker.batched_stream.send, {"op": OUTCOME, "key": key, **asdict(outcome)})


def _is_dropped(worker: Worker, key: str) -> bool:
    """Whether nobody wants the task any more: it was cancelled, or the scheduler or whoever asked is gone."""
    task = worker.state.tasks.get(key)
    return task is None or task.state != "executing" or worker.status not in (Status.running, Status.paused)


class _LastReport:
    """A ``TaskReport`` that sends the last word, ten times a second at most."""

    def __init__(self, worker: Worker, key: str) -> None:
        self._worker = worker
        self._key = key
        self._last: dict[str, Any] = {}
        self._is_waiting = False

    def __call__(self, sentence: str, share: float, detail: Mapping[str, Any] = _NOTHING, /) -> None:
        self._last = {"sentence": sentence, "share": float(share), "detail": json.dumps(dict(detail))}
        if not self._is_waiting:
            self._is_waiting = True
            loop = self._worker.loop
            loop.add_callback(loop.call_later, TELL_EVERY_S, self._send)

    def _send(self) -> None:
        self._is_waiting = False
        self._worker.batched_stream.send({"op": PROGRESS, "key": self._key, **self._last})
