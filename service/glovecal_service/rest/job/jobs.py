"""``jobs``: long work, how it begins, its progress, its report, and how to stop it."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import ValidationError

from glovecal_models.presentation.document import AboutTakes
from glovecal_service.plain import document_of, plain
from glovecal_service.questions.catalogue import ANSWERED
from glovecal_service.questions.model_work import model_title
from glovecal_service.request_types import IDENTIFIER
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.event_stream import looks
from glovecal_service.rest.http.list_part import ByTime
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.report_page import REPORT, ReportFormat, report_response
from glovecal_service.rest.http.request_types import IdInPath, SubjectFilter
from glovecal_service.rest.job.answer import Job, JobFacts, JobRow
from glovecal_service.store.errors import Conflict
from glovecal_service.store.jobs import UNFINISHED_JOB_STATES
from glovecal_service.store.records import FINISHED_JOB_STATES, JobEvent, JobRecord, JobState
from glovecal_service.store.store import Store

router = APIRouter(prefix="/jobs", tags=["jobs"])

LOOK_EVERY_S = 0.25
MOST_UNFINISHED_JOBS = 100


@router.get("", response_model=list[JobRow], summary="Jobs, newest first", responses=problems())
def list_jobs(
    store: StoreNeeded,
    paging: ByTime,
    subject: SubjectFilter = None,
    kind: Annotated[str | None, Query(pattern=IDENTIFIER, description="Such as `train`.")] = None,
    state: JobState | None = None,
    only_unfinished: bool = False,
) -> list[JobRow]:
    """Without their results, which `GET /v1/jobs/{id}` has. Damaged rows are left out and named in `Warning`
    headers. More than `limit`: see `Link`."""
    states = UNFINISHED_JOB_STATES if only_unfinished else None if state is None else (state,)
    page = store.jobs.page(paging.part, subject=subject, states=states, kind=kind)
    return [_row(record) for record in paging.answer(page)]


def _row(record: JobRecord) -> JobRow:
    result = record.result or {}
    own = {name: getattr(record, name) for name in JobFacts.model_fields}
    return JobRow(**own, has_result=bool(result), model=result.get("model"))


@router.get("/{id}", response_model=Job, summary="One job", responses=problems())
def get_job(id: IdInPath, store: StoreNeeded) -> Job:
    return _job(store.jobs.get(id))


@router.post("/{id}/cancel", response_model=Job, summary="Stop a job", responses=change_problems())
def cancel_job(id: IdInPath, store: StoreNeeded) -> Job:
    """A finished job stays as it is. What it finished so far is kept for the next try."""
    return _job(store.jobs.request_cancel(id))


def _job(record: JobRecord) -> Job:
    """With its result as its kind shows it today."""
    shown = replace(record, result=current_result(record.kind, record.result))
    return Job.model_validate(shown, from_attributes=True)


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
    last = last_event_id

    def look() -> tuple[dict[str, Any] | None, list[JobEvent]]:
        return _finished(store, job.id), store.jobs.events(job.id, last)

    async for finished, steps in looks(look, LOOK_EVERY_S):
        for step in steps:
            last = step.id
            yield ServerSentEvent(event="progress", id=str(step.id), data=_step(step))
        if finished is not None:
            yield ServerSentEvent(event="done", data=finished)
            return


def _finished(store: Store, id: str) -> dict[str, Any] | None:
    record = store.jobs.get(id)
    if record.state not in FINISHED_JOB_STATES:
        return None
    return _job(record).model_dump(mode="json")


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
    summary="What a job found, as a page",
    responses=problems(409) | REPORT,
)
def report_on_job(id: IdInPath, store: StoreNeeded, form: ReportFormat = "html") -> Response:
    """Each picture has a sentence that says what it shows. 409 until the job is done, and for other kinds."""
    job = store.jobs.get(id)
    if job.kind not in ANSWERED:
        *kinds, last = ANSWERED
        kinds = f"{', '.join(kinds)} and {last}"
        raise Conflict(f"job {id} is of kind {job.kind!r}; there are pages of {kinds} jobs")
    result = current_result(job.kind, job.result)
    if result is None:
        raise Conflict(f"job {id} is {job.state}; it has a page once it is done")
    try:
        answer = ANSWERED[job.kind].read(result)
    except ValidationError as error:
        raise Conflict(f"job {id} was answered by another version of Glovecal; ask again") from error
    if isinstance(answer, AboutTakes) and answer.model and not answer.title:  # stored before it was told
        answer = replace(answer, title=model_title(store, answer.model), subject=job.subject or "")
    return report_response(answer.presentation(), form)


def current_result(kind: str, result: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """With the keys of today; a result that is not what its kind promises is given as it was stored."""
    if result is None or kind not in ANSWERED:
        return None if result is None else dict(result)
    try:
        return document_of(ANSWERED[kind].read(result))
    except ValidationError:
        return dict(result)
