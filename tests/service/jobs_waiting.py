"""Waiting in tests: look until it is true, fail when that takes too long."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord


def wait_for(condition: Callable[[], Any], seconds: float = 300.0) -> Any:
    """What ``condition`` answers once it is true."""
    until = time.monotonic() + seconds
    while not (answer := condition()):
        assert time.monotonic() < until, f"not true within {seconds} s"
        time.sleep(0.01)
    return answer


def wait_for_job(store: Store, id: str) -> JobRecord:
    """The job once it is finished."""
    wait_for(lambda: store.jobs.get(id).is_finished)
    return store.jobs.get(id)


def result_of(store: Store, id: str) -> dict[str, Any]:
    """The result of a job that must be done."""
    job = wait_for_job(store, id)
    assert job.state == "done", job.error
    assert job.result is not None
    return job.result


def error_of(store: Store, id: str) -> str:
    """Why a job failed that must fail."""
    job = wait_for_job(store, id)
    assert job.state == "failed"
    assert job.error is not None
    return job.error
