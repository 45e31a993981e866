"""``erasures``: a subject is removed with all that is kept of it."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import Field

from glovecal_service.request_types import StrictBody, SubjectName
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.subject.answer import Erasure
from glovecal_service.store.erasure import ErasureRecord, erase

router = APIRouter(prefix="/erasures", tags=["subjects"])


class NewErasure(StrictBody):
    subject: SubjectName = Field(description="In the body, so that no log of requests has the name.")


@router.post(
    "",
    status_code=201,
    response_model=Erasure,
    summary="Erase a subject",
    responses=change_problems(409),
)
def erase_subject(body: NewErasure, parts: PartsNeeded) -> ErasureRecord:
    """All that `GET /v1/subjects/{name}/export` gives is removed, and cannot come back. The log of changes
    keeps who did it, when, how much, and the sha256 of each file. 409 while a recording, a sampling or a job
    of the subject goes on."""
    return erase(parts.store, parts.settings, body.subject)
