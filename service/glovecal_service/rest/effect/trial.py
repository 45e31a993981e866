"""``models/{id}/try-effect``: the held-out error that one effect would save, beside its control."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import BaseModel, Field

from glovecal_models.calibration.model_recipe import (
    declared_effects,
    repaired_takes,
    requested_effects,
)
from glovecal_models.calibration.training_settings import LINEAR_METHODS
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.known_effect import known_effects
from glovecal_models.effects.catalogue import known_by_name
from glovecal_models.errors import BadInput
from glovecal_service.rest.effect.declarations import AskedEffect, asked_effect
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import ModelInPath, StrictBody
from glovecal_service.rest.model.model_takes import TakesNamed, model_takes
from glovecal_service.views.diagnosis import CandidateView

router = APIRouter(prefix="/models", tags=["models"])

MOST_FRAMES = 200_000
"""Times rotations; more belong into a job."""


class TrialRequest(StrictBody):
    effect: AskedEffect
    takes: TakesNamed | None = Field(None, description="Ids or names; null: those it was trained on.")


class TrialView(BaseModel):
    model: str
    effect: str
    explanation: str
    takes: list[str] = Field(description="Their ids; each is left out once.")
    judged: CandidateView | None = Field(description="Null: these takes cannot show it.")
    not_identifiable: str | None = Field(description="Why these takes cannot show it.")


@router.post(
    "/{id}/try-effect",
    response_model=TrialView,
    summary="What one effect would save on left-out takes",
    responses=change_problems(409),
)
def try_effect(id: ModelInPath, body: TrialRequest, parts: PartsNeeded) -> TrialView:
    """As a diagnosis judges it, alone and in seconds: nothing is stored. 422 for an expression that cannot be
    read, and for one that has no value in some frame.
    """
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    rows = model_takes(parts.store, record, body.takes)
    effect = asked_effect(body.effect, model, rows)
    takes = [parts.store.takes.load(row.id) for row in rows]
    if sum(len(take.time_s) * len(take.rotations) for take in takes) > MOST_FRAMES:
        raise BadInput("so many frames take too long for an answer; name fewer takes, or diagnose in a job")
    with known_by_name([*declared_effects(model), effect]):
        found = diagnose(
            repaired_takes(takes, requested_effects(model)),
            model.layout,
            linear=model.method in LINEAR_METHODS,
            known=known_effects(model),
            effects=[effect],
            signatures=False,
            judge_residual=False,
            noise_floors={},
        )
    judged = next((item for item in found.assessments if item.effect == effect.name), None)
    why = next((item.why for item in found.not_identifiable if item.effect == effect.name), None)
    return TrialView(
        model=record.id,
        effect=effect.name,
        explanation=effect.explanation,
        takes=[row.id for row in rows],
        judged=None if judged is None else CandidateView.of(judged),
        not_identifiable=why,
    )
