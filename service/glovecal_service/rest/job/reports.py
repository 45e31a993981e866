"""``jobs/{id}/report``: what a finished job found, as a page with pictures."""

from __future__ import annotations

from fastapi import APIRouter, Response

from glovecal_service.rest.http.answers import problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.names import IdInPath
from glovecal_service.store.errors import Conflict

router = APIRouter(prefix="/jobs", tags=["jobs"])

WITH_PAGES = ("diagnose", "improve")


@router.get(
    "/{id}/report",
    response_class=Response,
    summary="What a diagnosis or an improvement found, as a page",
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
        raise Conflict(
            f"job {id} is of kind {job.kind!r}; there are pages of {' and '.join(WITH_PAGES)} jobs"
        )
    if job.result is None:
        raise Conflict(f"job {id} is {job.state}; it has a page once it is done")
    if job.kind == "diagnose":
        from glovecal_service.report.diagnosis_page import diagnosis_page  # draws: few requests need it

        page = diagnosis_page(job.result)
    else:
        from glovecal_service.report.improvement_page import improvement_page

        page = improvement_page(job.result, job.payload["method"], job.payload["subject"])
    return Response(page, media_type="text/html; charset=utf-8")
