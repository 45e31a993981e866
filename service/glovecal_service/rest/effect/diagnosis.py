"""``models/{id}/diagnose``: which physical effect a model lacks, as a job."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from glovecal_service.rest.effect.declarations import Declared, checked_declaration, declaration_document
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import ModelInPath, StrictBody
from glovecal_service.rest.job.jobs import JobFacts, new_job
from glovecal_service.rest.model.model_takes import TakesNamed, model_takes
from glovecal_service.store.records import JobRecord
from glovecal_service.views.diagnosis import DiagnosisResult

router = APIRouter(prefix="/models", tags=["models"])

MOST_DECLARATIONS = 8


class DiagnosisJob(JobFacts):
    result: DiagnosisResult | None


class DiagnosisRequest(StrictBody):
    takes: TakesNamed | None = Field(None, description="Ids or names; null: those it was trained on.")
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(0, description="Of the controls.")
    effects: Annotated[list[Declared], Field(max_length=MOST_DECLARATIONS)] = Field(
        default=[], description="Effects of your own, tried beside the catalogue's."
    )


@router.post(
    "/{id}/diagnose",
    status_code=202,
    response_model=DiagnosisJob,
    summary="Find which physical effect the model lacks",
    responses=change_problems(409),
)
def diagnose_model(
    id: ModelInPath, body: DiagnosisRequest, store: StoreNeeded, response: Response
) -> JobRecord:
    """The job's result is the diagnosis; `GET /v1/jobs/{id}/report` shows it with pictures."""
    record = store.models.get(id)
    takes = model_takes(store, record, body.takes)
    sensors = store.layouts.get(record.layout).sensors
    own = [checked_declaration(item.declaration, takes, sensors) for item in body.effects]
    payload = {
        "model": record.id,
        "takes": [take.id for take in takes],
        "seed": body.seed,
        "declarations": [declaration_document(item) for item in own],
    }
    return new_job(store, response, "diagnose", payload, record.subject)
