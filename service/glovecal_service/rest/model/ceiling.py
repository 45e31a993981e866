"""``models/{id}/ceiling``: whether anything is left to gain from what was recorded, as a job."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import ModelInPath, StrictBody
from glovecal_service.rest.job.jobs import JobFacts, new_job
from glovecal_service.rest.model.model_takes import TakesNamed, model_takes
from glovecal_service.store.records import JobRecord
from glovecal_service.views.ceiling import CeilingResult

router = APIRouter(prefix="/models", tags=["models"])


class CeilingJobFacts(JobFacts):
    result: CeilingResult | None


class CeilingRequest(StrictBody):
    takes: TakesNamed | None = Field(None, description="Ids or names; null: those it was trained on.")
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(0, description="Of trees and controls.")


@router.post(
    "/{id}/ceiling",
    status_code=202,
    response_model=CeilingJobFacts,
    summary="Find whether anything is left to gain from what was recorded",
    responses=change_problems(409),
)
def ceiling_of_model(
    id: ModelInPath, body: CeilingRequest, store: StoreNeeded, response: Response
) -> JobRecord:
    """A black box on everything recorded, against the model's held-out error; the verdict has an interval.

    `compare`, `where` and `diagnose` show it afterwards.
    """
    record = store.models.get(id)
    takes = model_takes(store, record, body.takes)
    payload = {"model": record.id, "takes": [take.id for take in takes], "seed": body.seed}
    return new_job(store, response, "ceiling", payload, record.subject)
