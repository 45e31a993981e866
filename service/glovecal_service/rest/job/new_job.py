"""Long work begun by a request: a job in the queue, and where to find it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fastapi import Response

from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import JobRecord
from glovecal_service.store.store import Store

MOST_UNFINISHED_JOBS = 100


def new_job(
    store: Store, response: Response, kind: str, payload: Mapping[str, Any], subject: str
) -> JobRecord:
    """The job, its address in the answer's ``Location``. Raises Conflict when too many are waiting."""
    if sum(store.jobs.unfinished().values()) >= MOST_UNFINISHED_JOBS:
        raise Conflict(f"{MOST_UNFINISHED_JOBS} jobs are waiting already; cancel some or wait")
    record = store.jobs.create(kind, payload, subject=subject)
    response.headers["Location"] = f"/v1/jobs/{record.id}"
    return record
