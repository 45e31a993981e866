"""``models/{id}/effects``: give a calibration model an effect, or take one out; each makes a new version."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import Field

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.model_recipe import declaration_of, trained_rotations
from glovecal_models.effects.catalogue import effect as known_effect
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.rest.effect.catalogue import EffectInPath, can_be_added
from glovecal_service.rest.effect.declarations import (
    AskedEffect,
    Declared,
    checked_declaration,
    declaration_document,
)
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import Channel, ModelInPath, StrictBody
from glovecal_service.rest.job.jobs import Job, JobFacts, new_job
from glovecal_service.rest.model.model_takes import TakesNamed, model_takes
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.records import JobRecord, TakeRecord
from glovecal_service.views.addition import AdditionResult

router = APIRouter(prefix="/models", tags=["models"])

MOST_ROTATIONS = 512
WHY_NOT = {
    "finding": "it is found, not fitted: no correction brings back what the recording lost",
    "repair": "it is a fault of the measurement that has no repair",
    "nothing": "it is the null hypothesis",
}


class AdditionJob(JobFacts):
    result: AdditionResult | None


class AdditionRequest(StrictBody):
    effect: AskedEffect
    rotations: Annotated[list[Channel], Field(min_length=1, max_length=MOST_ROTATIONS)] | None = Field(
        None, description="Null: all that the model has learned."
    )
    takes: TakesNamed | None = Field(None, description="Ids or names; null: those it was trained on.")
    activate: bool = Field(False, description="Predict live with the child, if the effect stays.")


@router.post(
    "/{id}/effects",
    status_code=202,
    response_model=AdditionJob,
    summary="Add an effect",
    responses=change_problems(409),
)
def add_effect(id: ModelInPath, body: AdditionRequest, parts: PartsNeeded, response: Response) -> JobRecord:
    """A child model is stored if the held-out error falls; else the job's result says why not."""
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    takes = model_takes(parts.store, record, body.takes)
    rotations = _checked_rotations(model, body.rotations)
    payload: dict[str, Any] = {"model": record.id, "takes": [take.id for take in takes]}
    payload |= {"rotations": rotations, "activate": body.activate, "declaration": None}
    if isinstance(body.effect, Declared):
        own = checked_declaration(body.effect.declaration, takes, model.layout.sensors)
        payload |= {"effect": own.name, "declaration": declaration_document(own)}
    else:
        payload |= _named(model, body.effect, takes)
    if not set(rotations or trained_rotations(model)) - _rotations_with(model, payload["effect"]):
        raise Conflict(f"model {record.id[:12]} has {payload['effect']} on all of these rotations already")
    return new_job(parts.store, response, "add_effect", payload, record.subject)


@router.delete(
    "/{id}/effects/{name}",
    status_code=202,
    response_model=Job,
    summary="Take an effect out",
    responses=change_problems(409),
)
def remove_effect(
    id: ModelInPath,
    name: EffectInPath,
    parts: PartsNeeded,
    response: Response,
    activate: Annotated[bool, Query(description="Predict live with the child.")] = False,
) -> JobRecord:
    """A child model without it is stored; this one stays as it is."""
    record = parts.store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    has = list(dict.fromkeys(item.name for item in model.effects))
    if name not in has:
        meant = did_you_mean(name, has, there="it has")
        raise NotFound(f"model {record.id[:12]} has no effect {name!r}; {meant}")
    model_takes(parts.store, record, None)
    payload = {"model": record.id, "effect": name, "activate": activate}
    return new_job(parts.store, response, "remove_effect", payload, record.subject)


def _named(model: CalibrationModel, name: str, takes: Sequence[TakeRecord]) -> dict[str, Any]:
    """An effect of the catalogue, or one of the user's own that the model has already on other rotations."""
    declaration = declaration_of(model, name)
    if declaration is None:
        effect = known_effect(name)
        if not can_be_added(effect):
            raise BadInput(f"effect {name!r} cannot be added to a model: {WHY_NOT[effect.kind]}")
        recorded = {column for take in takes for column in take.context}
        for column in effect.context:
            if column not in recorded:
                there = ", ".join(f"c.{other}" for other in sorted(recorded)) or "none"
                raise BadInput(
                    f"effect {name!r} needs the context column c.{column}; these takes have {there}"
                )
    return {"effect": name, "declaration": None if declaration is None else dict(declaration)}


def _rotations_with(model: CalibrationModel, name: str) -> set[str]:
    return {rotation for item in model.effects if item.name == name for rotation in item.active}


def _checked_rotations(model: CalibrationModel, wanted: list[str] | None) -> list[str] | None:
    """Raises BadInput for a rotation that the model has not learned."""
    if wanted is None:
        return None
    every = trained_rotations(model)
    for name in wanted:
        if name not in every:
            meant = did_you_mean(name, every, there="it has")
            raise BadInput(f"no rotation {name!r} is trained in this model; {meant}")
    return list(dict.fromkeys(wanted))
