"""``models/{id}/try-effect``: the held-out error that one effect would save, beside its control."""

from __future__ import annotations

from fastapi import APIRouter, Request
from pydantic import Field

from glovecal_models.diagnosis.text import candidate
from glovecal_models.diagnosis.trial.answer import TriedEffect
from glovecal_models.effects.catalogue import DeclaredEffect
from glovecal_models.errors import BadInput
from glovecal_models.progress import Cancel
from glovecal_service.questions.chosen_takes import TakesNamed, model_takes
from glovecal_service.questions.declarations import AskedEffect, asked_effect, declaration_document
from glovecal_service.questions.effect_trial import EffectTrial
from glovecal_service.questions.effect_trial import try_effect as judge_effect
from glovecal_service.questions.model_work import is_short
from glovecal_service.request_types import StrictBody
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.long_answers import in_process, in_time
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.http.request_types import ModelInPath

router = APIRouter(prefix="/models", tags=["models"])

LIMIT_S = 60.0
MOST_FRAMES = 200_000
"""Times rotations; more belong into a job."""


class TrialRequest(StrictBody):
    effect: AskedEffect
    takes: TakesNamed | None = Field(None, description="Ids or names; null: those it was trained on.")


@router.post(
    "/{id}/try-effect",
    response_model=TriedEffect,
    summary="What one effect would save on left-out takes",
    responses=change_problems(409),
)
async def try_effect(
    id: ModelInPath, body: TrialRequest, request: Request, parts: PartsNeeded
) -> TriedEffect:
    """As a diagnosis judges it, alone and in seconds: nothing is stored. 422 for an expression that cannot be
    read, for one that has no value in some frame, and for one that takes longer than a minute.
    """

    def compute(cancelled: Cancel) -> TriedEffect:
        return _tried(id, body, parts, cancelled)

    return await in_time(request, parts, compute, limit_s=LIMIT_S, what="this trial")


def _tried(id: str, body: TrialRequest, parts: Parts, cancelled: Cancel) -> TriedEffect:
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    rows = model_takes(parts.store, record, body.takes)
    effect = asked_effect(body.effect, model, rows)
    takes = [parts.store.takes.load(row.id) for row in rows]
    if sum(len(take.time_s) * len(take.rotations) for take in takes) > MOST_FRAMES:
        raise BadInput("so many frames take too long for an answer; name fewer takes, or diagnose in a job")
    declaration = declaration_document(effect) if isinstance(effect, DeclaredEffect) else None
    trial = EffectTrial(parts.store.models.load_bytes(record.id), takes, effect.name, declaration)
    if declaration is None and is_short(takes):
        found = judge_effect(trial)
    else:
        found = in_process(judge_effect, trial, "this trial", cancelled)
    return TriedEffect(
        model=record.id,
        effect=effect.name,
        explanation=effect.about.explanation,
        takes=[row.id for row in rows],
        judged=None if found.judged is None else candidate(found.judged),
        not_identifiable=found.not_identifiable,
    )
