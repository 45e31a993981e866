"""A model and one effect in; out a stored child, or why the effect was undone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from pydantic import Field

from glovecal_models.calibration.artifact import load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import declaration_of, trained_rotations
from glovecal_models.effects.base.effect import kind_of
from glovecal_models.effects.catalogue import effect as known_effect
from glovecal_models.effects.catalogue import effect_of_declaration
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.answer import EffectAdded
from glovecal_models.improvement.text import effect_tried
from glovecal_models.names import did_you_mean
from glovecal_models.progress import Report
from glovecal_service.jobs.job_kind import JobPlan, Step, TaskResult
from glovecal_service.questions.chosen_takes import TakesNamed, model_takes
from glovecal_service.questions.declarations import (
    AskedEffect,
    Declared,
    checked_declaration,
    declaration_document,
)
from glovecal_service.questions.making import Begun, Making, keep, made, models_of, one_task
from glovecal_service.questions.model_work import ModelWork, model_title, takes_of, text_in
from glovecal_service.request_types import Channel, StrictBody
from glovecal_service.store import Store
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import JobRecord, TakeRecord

MOST_ROTATIONS = 512
CAN_BE_ADDED = ("correction", "repair", "interval")
"""Kinds: corrections, and what is found in a recording as far as it can be repaired or claimed."""
WHY_NOT = {
    "finding": "it is found, not fitted: no correction brings back what the recording lost",
    "repair": "it is a fault of the measurement that has no repair",
    "nothing": "it is the null hypothesis",
}


class AdditionRequest(StrictBody):
    effect: AskedEffect
    rotations: Annotated[list[Channel], Field(min_length=1, max_length=MOST_ROTATIONS)] | None = None
    """Null: all that the model has learned."""
    takes: TakesNamed | None = None
    """Ids or names; null: those it was trained on."""
    activate: bool = False
    """Predict live with the child, if the effect stays."""


def begin(store: Store, body: AdditionRequest, id: str) -> Begun:
    record = store.models.get(id)
    model = load(store.models.load_bytes(record.id))
    takes = model_takes(store, record, body.takes)
    rotations = _checked_rotations(model, body.rotations)
    payload: dict[str, Any] = {"model": record.id, "takes": [take.id for take in takes]}
    payload |= {"rotations": rotations, "activate": body.activate}
    if isinstance(body.effect, Declared):
        own = checked_declaration(body.effect.declaration, takes, model.layout.sensors)
        payload |= {"effect": own.name, "declaration": declaration_document(own)}
    else:
        payload |= _named(model, body.effect, takes)
    has = {name for item in model.effects if item.name == payload["effect"] for name in item.active}
    if not set(rotations or trained_rotations(model)) - has:
        raise Conflict(f"model {record.id[:12]} has {payload['effect']} on all of these rotations already")
    return Begun(record.subject, payload)


def _named(model: CalibrationModel, name: str, takes: Sequence[TakeRecord]) -> dict[str, Any]:
    """An effect of the catalogue, or one of the user's own that the model has already on other rotations."""
    declaration = declaration_of(model, name)
    if declaration is None:
        effect = known_effect(name)
        if kind_of(effect) not in CAN_BE_ADDED:
            raise BadInput(f"effect {name!r} cannot be added to a model: {WHY_NOT[kind_of(effect)]}")
        recorded = {column for take in takes for column in take.context}
        for column in effect.context:
            if column not in recorded:
                there = ", ".join(f"c.{other}" for other in sorted(recorded)) or "none"
                raise BadInput(
                    f"effect {name!r} needs the context column c.{column}; these takes have {there}"
                )
    return {"effect": name, "declaration": None if declaration is None else dict(declaration)}


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


@dataclass(frozen=True)
class AdditionWork:
    on: ModelWork
    effect: str
    declaration: dict[str, Any] | None
    """Of a user's own effect."""
    rotations: tuple[str, ...] | None


def plan(store: Store, job: JobRecord) -> JobPlan:
    """Raises NotFound (model, takes), NotTrainable (no reference), BadInput, DamagedArtifact."""
    payload = job.payload
    record = store.models.get(text_in(payload, "model"))
    takes = takes_of(store, record, payload.get("takes"))
    on, rotations = ModelWork.of(store, record, takes), payload.get("rotations")
    effect, declaration = text_in(payload, "effect"), payload.get("declaration")
    work = AdditionWork(on, effect, declaration, None if rotations is None else tuple(rotations))

    def finish(result: TaskResult) -> EffectAdded:
        found = ADD_EFFECT.read(result.facts)
        found = replace(found, parent=record.id, title=model_title(store, record.id))
        if not found.added:
            return found
        active = bool(payload.get("activate", False))
        [model] = models_of(result)
        facts = {"addition": result.facts, "sentences": [found.sentence]}
        child = keep(store, model, record.layout, takes, on.settings, facts, activate=active)
        return replace(found, model=child.id, active=active)

    return one_task(
        "add_effect",
        {**on.identity, "effect": effect, "declaration": declaration, "rotations": rotations},
        f"{effect} on model {record.id[:12]}",
        run,
        work,
        _step,
        finish,
        is_short=on.is_short,
    )


def run(work: AdditionWork, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """In a worker. Raises BadInput, NotTrainable, Cancelled."""
    on, model = work.on, work.on.model
    known = model.error_estimate.get("rmse_deg")
    error = "" if known is None else f", held-out error {known:.2f} degrees so far"
    report(f"looking at the takes for {work.effect}{error}", 0.0)
    found = add_effect(
        model,
        on.takes,
        work.effect if work.declaration is None else effect_of_declaration(work.declaration),
        rotations=work.rotations,
        settings=on.settings,
        parent_id=on.id,
        take_hashes=on.take_hashes,
        cancelled=cancelled,
        report=report,
    )
    return made(EffectAdded(**effect_tried(found)), [found.model] if found.added else [])


def _step(facts: Mapping[str, Any]) -> Step:
    """The last word before the model is stored: the held-out errors before and after."""
    return Step(facts["sentence"], {name: facts[name] for name in ("effect", "added", "before", "after")})


ADD_EFFECT = Making(
    kind="add_effect",
    address="/models/{id}/effects",
    summary="Add an effect",
    help="A child model is stored if the held-out error falls; else the job's result says why not.",
    request=AdditionRequest,
    answer=EffectAdded,
    begin=begin,
    planned=plan,
)
