"""``detectability`` of a model's or a subject's takes, as a job: what these takes could have shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Response
from pydantic import Field, FiniteFloat

from glovecal_models.effects.catalogue import effect
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.names import did_you_mean
from glovecal_service.rest.effect.declarations import Declared, checked_declaration, declaration_document
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import (
    Channel,
    Identifier,
    ModelInPath,
    StrictBody,
    SubjectInPath,
)
from glovecal_service.rest.job.jobs import JobFacts, new_job
from glovecal_service.rest.model.model_takes import TakesNamed, model_takes, takes_named
from glovecal_service.store.records import JobRecord, TakeRecord
from glovecal_service.views.detectability import DetectabilityResult

router = APIRouter(tags=["models"])

EffectName = Annotated[str, Field(min_length=1, max_length=200)]
Size = Annotated[FiniteFloat, Field(gt=0, le=90)]


class DetectabilityJobFacts(JobFacts):
    result: DetectabilityResult | None


class DetectabilityRequest(StrictBody):
    effects: Annotated[list[EffectName], Field(min_length=1, max_length=32)] | None = Field(
        None, description="Names; null: every effect that a diagnosis compares."
    )
    declarations: Annotated[list[Declared], Field(max_length=8)] = Field(
        default=[], description="Effects of your own to put in."
    )
    rotations: Annotated[list[Channel], Field(min_length=1, max_length=64)] | None = Field(
        None, description="Each effect is put into each of these by itself; null: into all at once."
    )
    sizes_deg: Annotated[list[Size], Field(min_length=1, max_length=12)] = Field(
        [0.5, 1.0, 2.0, 4.0], description="RMS degrees of what no static map explains."
    )
    trials: Annotated[int, Field(ge=1, le=50)] = Field(3, description="For each size.")
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(0, description="Of noise, weights and controls.")


class ModelDetectabilityRequest(DetectabilityRequest):
    takes: TakesNamed | None = Field(None, description="Ids or names; null: those it was trained on.")


class SubjectDetectabilityRequest(DetectabilityRequest):
    layout: Identifier
    takes: TakesNamed = Field(description="Ids or names.")


@router.post(
    "/models/{id}/detectability",
    status_code=202,
    response_model=DetectabilityJobFacts,
    summary="Find how large effects must be to be named in a model's takes",
    responses=change_problems(409),
)
def detectability_of_model(
    id: ModelInPath, body: ModelDetectabilityRequest, store: StoreNeeded, response: Response
) -> JobRecord:
    """Effects are put into the takes at known sizes and diagnosed again; effects that look alike are listed.

    `GET /v1/jobs/{id}/report` shows it with a picture.
    """
    record = store.models.get(id)
    takes = model_takes(store, record, body.takes)
    payload = _payload(body, takes, store.layouts.get(record.layout))
    payload |= {"model": record.id, "subject": record.subject, "layout": record.layout}
    return new_job(store, response, "detectability", payload, record.subject)


@router.post(
    "/subjects/{name}/detectability",
    status_code=202,
    response_model=DetectabilityJobFacts,
    summary="The same of takes, before any model is trained",
    responses=change_problems(409),
)
def detectability_of_subject(
    name: SubjectInPath, body: SubjectDetectabilityRequest, store: StoreNeeded, response: Response
) -> JobRecord:
    """As of a model that has a flexible static map and no effect."""
    subject = store.subjects.get(name).name
    takes = takes_named(store, body.takes, subject, body.layout)
    payload = _payload(body, takes, store.layouts.get(body.layout))
    payload |= {"model": None, "subject": subject, "layout": body.layout}
    return new_job(store, response, "detectability", payload, subject)


def _payload(body: DetectabilityRequest, takes: Sequence[TakeRecord], layout: Layout) -> dict[str, Any]:
    """Raises BadInput for an effect or rotation that does not exist."""
    for name in body.effects or ():
        effect(name)
    unknown = [name for name in body.rotations or () if name not in layout.rotations]
    if unknown:
        raise BadInput(
            f"no rotation {unknown[0]!r} in this layout; {did_you_mean(unknown[0], layout.rotations)}"
        )  # fmt: skip
    own = [checked_declaration(item.declaration, takes, layout.sensors) for item in body.declarations]
    facts = body.model_dump(include={"effects", "rotations", "sizes_deg", "trials", "seed"})
    return {
        **facts,
        "takes": [take.id for take in takes],
        "declarations": [declaration_document(item) for item in own],
    }
