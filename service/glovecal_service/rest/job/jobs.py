"""``jobs``: long work, how it begins, its progress, its report, and how to stop it."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Mapping
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import BaseModel, Field, ValidationInfo, field_validator

from glovecal_service.plain import plain
from glovecal_service.rest.http.answers import change_problems, problems
from glovecal_service.rest.http.damaged_rows import without_damaged
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import IdInPath, SubjectFilter
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import FINISHED_JOB_STATES, JobEvent, JobRecord, JobState
from glovecal_service.store.store import Store
from glovecal_service.views.job_result import current_result

router = APIRouter(prefix="/jobs", tags=["jobs"])

LOOK_EVERY_S = 0.25
MOST_UNFINISHED_JOBS = 100
WITH_PAGES = ("diagnose", "detectability", "improve")
LONGEST_STREAM_S = 3600.0
"""After this the stream ends without ``done``; listeners connect again with ``Last-Event-ID``."""


class JobFacts(BaseModel):
    id: str
    kind: str
    subject: str | None
    payload: dict[str, Any]
    state: JobState
    attempt: int
    cancel_requested: bool
    fraction: float = Field(description="Done so far, 0 to 1.")
    sentence: str
    detail: dict[str, Any]
    error: str | None
    traceback: str | None = Field(
        description="Python's, of a job that failed by an error in Glovecal itself; at most 8,000 characters."
    )
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    updated_at: datetime


class Job(JobFacts):
    result: dict[str, Any] | None = Field(description="Of a job of its kind: see where it is begun.")

    @field_validator("result", mode="before")
    @classmethod
    def _current_keys(cls, result: Any, info: ValidationInfo) -> Any:
        return current_result(info.data.get("kind", ""), result)


@router.get("", response_model=list[Job], summary="Jobs, newest first", responses=problems())
def list_jobs(
    store: StoreNeeded, response: Response, subject: SubjectFilter = None, only_unfinished: bool = False
) -> list[JobRecord]:
    """Damaged rows are left out and named in `Warning` headers."""
    return without_damaged(
        response, lambda: store.jobs.list(subject=subject, only_unfinished=only_unfinished)
    )


@router.get("/{id}", response_model=Job, summary="One job", responses=problems())
def get_job(id: IdInPath, store: StoreNeeded) -> JobRecord:
    return store.jobs.get(id)


@router.post("/{id}/cancel", response_model=Job, summary="Stop a job", responses=change_problems())
def cancel_job(id: IdInPath, store: StoreNeeded) -> JobRecord:
    """A finished job stays as it is. What it finished so far is kept for the next try."""
    return store.jobs.request_cancel(id)


def _known_job(id: IdInPath, store: StoreNeeded) -> JobRecord:
    return store.jobs.get(id)


@router.get(
    "/{id}/events",
    response_class=EventSourceResponse,
    summary="A job's progress as it happens",
    responses=problems(),
)
async def job_events(
    job: Annotated[JobRecord, Depends(_known_job)],
    store: StoreNeeded,
    last_event_id: Annotated[int, Header(ge=0, le=2**62, description="Only what came after it.")] = 0,
) -> AsyncIterator[ServerSentEvent]:
    """Server-sent events: `progress` for each step from the first on, then `done` with the whole job."""
    until = time.monotonic() + LONGEST_STREAM_S
    while time.monotonic() < until:
        finished = await asyncio.to_thread(_finished, store, job.id)
        for step in await asyncio.to_thread(store.jobs.events, job.id, last_event_id):
            last_event_id = step.id
            yield ServerSentEvent(event="progress", id=str(step.id), data=_step(step))
        if finished is not None:
            yield ServerSentEvent(event="done", data=finished)
            return
        await asyncio.sleep(LOOK_EVERY_S)


def _finished(store: Store, id: str) -> dict[str, Any] | None:
    record = store.jobs.get(id)
    if record.state not in FINISHED_JOB_STATES:
        return None
    return Job.model_validate(record, from_attributes=True).model_dump(mode="json")


def _step(step: JobEvent) -> dict[str, Any]:
    names = ("attempt", "state", "fraction", "sentence", "detail")
    return plain({name: getattr(step, name) for name in names})


def new_job(
    store: Store, response: Response, kind: str, payload: Mapping[str, Any], subject: str
) -> JobRecord:
    """The job, its address in the answer's ``Location``. Raises Conflict when too many are waiting."""
    if sum(store.jobs.unfinished().values()) >= MOST_UNFINISHED_JOBS:
        raise Conflict(f"{MOST_UNFINISHED_JOBS} jobs are waiting already; cancel some or wait")
    record = store.jobs.create(kind, payload, subject=subject)
    response.headers["Location"] = f"/v1/jobs/{record.id}"
    return record


@router.get(
    "/{id}/report",
    response_class=Response,
    summary="What a diagnosis, an improvement or trials of effects found, as a page",
    responses=problems(409)
    | {
        200: {
            "description": "One HTML file that needs nothing else.",
            "content": {"text/html": {"schema": {"type": "string"}}},
        }
    },
)
def report_on_job(id: IdInPath, store: StoreNeeded) -> Response:
    """Each picture has a sentence that says what it shows. 409 until the job is done, and for other kinds."""
    job = store.jobs.get(id)
    if job.kind not in WITH_PAGES:
        kinds = f"{', '.join(WITH_PAGES[:-1])} and {WITH_PAGES[-1]}"
        raise Conflict(f"job {id} is of kind {job.kind!r}; there are pages of {kinds} jobs")
    result = current_result(job.kind, job.result)
    if result is None:
        raise Conflict(f"job {id} is {job.state}; it has a page once it is done")
    from glovecal_service.report.caption import caption_of  # pages draw: few requests need them

    if job.kind == "diagnose":
        from glovecal_service.report.diagnosis_page import diagnosis_page

        caption = caption_of(store, str(result.get("model", "")))
        page = diagnosis_page(result, caption, job.payload.get("declarations") or ())
    elif job.kind == "detectability":
        from glovecal_service.report.detectability_page import detectability_page

        of = result.get("model")
        page = detectability_page(result, None if of is None else caption_of(store, str(of)))
    else:
        from glovecal_service.report.improvement_page import improvement_page

        caption = caption_of(store, str(result["steps"][-1].get("model") or ""))
        page = improvement_page(result, job.payload["method"], job.payload["subject"], caption)
    return Response(page, media_type="text/html; charset=utf-8")
