"""``models/{id}/explain``: what the angles of one frame are made of."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field, FiniteFloat

from glovecal_models.calibration.explanation import chosen_rotations, explain
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import Channel, ModelInPath, StrictBody, TakeReference
from glovecal_service.rest.model.model_takes import takes_for
from glovecal_service.views.explanation import ExplanationView, explanation_view

router = APIRouter(prefix="/models", tags=["models"])

MOST_ROTATIONS = 512


class OneFrame(StrictBody):
    take: TakeReference
    at_s: FiniteFloat = Field(description="Seconds by the take's clock; the nearest frame is explained.")
    rotations: Annotated[list[Channel], Field(max_length=MOST_ROTATIONS)] = Field(
        default=[], description="Only these; empty: all of the model."
    )


@router.post(
    "/{id}/explain",
    response_model=ExplanationView,
    summary="What one frame's angles are made of",
    responses=change_problems(409),
)
def explain_angles(id: ModelInPath, body: OneFrame, parts: PartsNeeded) -> ExplanationView:
    """The base's value and what each effect adds, each with its standard deviation; they add up to the angle.

    422 for a time outside the take and for a rotation that the model does not have.
    """
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    rotations = chosen_rotations(model, body.rotations)
    (take,) = takes_for(parts.store, record, [body.take], measured=False)
    loaded = parts.store.takes.load(take.id)
    with parts.predictors.one_at_a_time:
        found = explain(model, loaded, body.at_s)
    return explanation_view(found, record.id, take.id, rotations)
