"""``improve``: the whole loop walked by itself, as a job."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import Field

from glovecal_models.errors import BadInput
from glovecal_service.jobs.training_takes import require_one_hand
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import Identifier, StrictBody, SubjectName
from glovecal_service.rest.job.jobs import JobFacts, new_job
from glovecal_service.rest.model.model_takes import TakesNamed, takes_named
from glovecal_service.store.records import JobRecord
from glovecal_service.views.improvement import ImprovementView

router = APIRouter(prefix="/improve", tags=["models"])


class ImprovementJob(JobFacts):
    result: ImprovementView | None


class ImprovementRequest(StrictBody):
    subject: SubjectName
    layout: Identifier
    takes: TakesNamed = Field(description="Ids or names of the takes to learn from.")
    holdout: TakesNamed | None = Field(
        None, description="Errors are on these; null: on takes held out of each fit."
    )
    method: Literal["linear", "lmc_gpr", "spgp", "auto", "polynomial_gpr", "general_gpr"] = "lmc_gpr"
    samples: Annotated[int, Field(ge=10, le=5000)] = Field(2000, description="At most, for one rotation.")
    max_steps: Annotated[int, Field(ge=0, le=20)] = Field(6, description="Effects to add at most.")
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(0, description="Of controls and floors.")
    ceiling: bool = Field(True, description="Ask at the end whether anything is left to gain.")
    activate: bool = Field(False, description="Predict live with the last model.")


@router.post(
    "",
    status_code=202,
    response_model=ImprovementJob,
    summary="Train, and add what the diagnosis names while it pays",
    responses=change_problems(409),
)
def improve(body: ImprovementRequest, store: StoreNeeded, response: Response) -> JobRecord:
    """The job's result: `steps` (model, effect added, errors), noise floors, why it stopped, what remains.

    Each step's model is stored, with the one before it as its parent. `GET /v1/jobs/{id}/report` shows the
    fall of the error.
    """
    store.subjects.get(body.subject)
    store.layouts.get(body.layout)
    takes = takes_named(store, body.takes, body.subject, body.layout)
    holdout = takes_named(store, body.holdout or (), body.subject, body.layout)
    require_one_hand([*takes, *holdout])
    both = {take.id for take in takes} & {take.id for take in holdout}
    if both:
        name = next(take.name for take in takes if take.id in both)
        raise BadInput(f"take {name!r} is to be learned from and held out; choose one of the two")
    payload: dict[str, Any] = body.model_dump() | {
        "takes": [take.id for take in takes],
        "holdout": [take.id for take in holdout],
    }
    return new_job(store, response, "improve", payload, body.subject)
