"""``models/{id}/fall``: how the error fell from simpler calibrations through each version to this one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from fastapi import APIRouter

from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.noise_floor import takes_noise
from glovecal_models.errors import NotTrainable
from glovecal_models.improvement.fall.answer import ErrorFall, FallStep, FloorBand
from glovecal_models.improvement.fall.lineage import (
    SIMPLER,
    lineage_falls,
    simpler_calibrations,
    version_label,
    with_control,
)
from glovecal_models.presentation.document import TakeNamed
from glovecal_models.takes.take import Take
from glovecal_service.questions.model_work import leave_out_folds, settings_of, trained_ids
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import problems
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.store.records import ModelRecord, TakeRecord

router = APIRouter(prefix="/models", tags=["models"])


@router.get(
    "/{id}/fall",
    response_model=ErrorFall,
    summary="How the error fell down to this version",
    responses=problems(409),
)
def error_fall(id: ModelInPath, parts: PartsNeeded) -> ErrorFall:
    """On the subject's takes that no version was trained on; where there is none, on those held out of each
    training in turn. Simpler calibrations are trained anew for it, on the first version's takes.

    422 where neither is there.
    """
    line = parts.store.models.lineage(id)[::-1]
    models = [parts.predictors.get(record.id)[0] for record in line]
    trained = [parts.store.takes.get(id) for id in trained_ids(parts.store, line[0])]
    held_out = _held_out(parts, line, models)
    shown = held_out or [take for take in trained if take.has_reference]
    takes = [parts.store.takes.load(take.id) for take in shown]
    learned = [parts.store.takes.load(take.id) for take in trained]
    methods: list[Method] = [method for method in SIMPLER if method != models[0].method]
    if held_out:
        simpler = simpler_calibrations(learned, models[0].layout, line[0].subject, methods, 0)
        falls = lineage_falls(models, simpler, takes)
    else:
        line, falls = _held_out_in_training(line, models, learned, methods)
    versions: list[ModelRecord | None] = [*[None] * (len(falls) - len(line)), *line]
    return ErrorFall(
        model=line[-1].id,
        steps=[
            replace(
                fall,
                label=" ".join(fall.label.split()),
                model=None if record is None else record.id,
                effects=() if record is None else record.facts.get("effects", ()),
            )
            for fall, record in zip(falls, versions, strict=True)
        ],
        floor=_floor(takes, models[-1]),
        takes=[TakeNamed(take.id, take.name) for take in shown],
        is_held_out=bool(held_out),
    )


def _held_out(parts: Parts, line: list[ModelRecord], models: list[CalibrationModel]) -> list[TakeRecord]:
    """Measured takes of the subject and layout that no version has seen."""
    seen = {artifact for model in models for artifact in model.takes}
    named = {id for record in line for id in trained_ids(parts.store, record)}
    return [
        take
        for take in parts.store.takes.list(subject=line[0].subject)
        if take.layout == line[0].layout
        and take.has_reference
        and take.artifact not in seen
        and take.id not in named
    ]


def _held_out_in_training(
    line: list[ModelRecord], models: list[CalibrationModel], takes: list[Take], methods: Sequence[Method]
) -> tuple[list[ModelRecord], list[FallStep]]:
    """Of versions whose training held takes out in turn; the others are left out.

    Raises NotTrainable when there is none.
    """
    own = [
        (record, model)
        for record, model in zip(line, models, strict=True)
        if record.facts.get("held_out_rmse_deg") is not None
    ]
    if not own:
        raise NotTrainable(
            f"no error of model {line[-1].id[:12]} is known: it was trained without holding takes out, and "
            "every measured take was trained on; record one more"
        )
    folds = leave_out_folds(settings_of(line[0]))
    simpler = simpler_calibrations(takes, models[0].layout, line[0].subject, methods, folds)
    falls = [
        FallStep(name, float(error), is_scale=True)
        for name, model in simpler.items()
        if (error := model.error_estimate.get("rmse_deg")) is not None
    ]
    falls.sort(key=lambda item: -item.rmse_deg)
    before: CalibrationModel | None = None
    errors: dict[str, float] = {}
    for record, model in own:
        control = None
        if before is not None and errors:
            square = np.square([list(errors.values())])
            control = with_control(model, before, square, tuple(errors))
        falls.append(
            FallStep(version_label(model, before), float(record.facts["held_out_rmse_deg"]), control)
        )
        kept = record.facts.get("per_rotation") or {}
        before, errors = model, {name: error for name, error in kept.items() if error is not None}
    return [record for record, _ in own], falls


def _floor(takes: list[Take], model: CalibrationModel) -> FloorBand | None:
    """Over all rotations that the model has; None when that of one is unknown."""
    names = [item.rotation for item in model.rotations]
    measured = [name for name in names if any(name in take.rotations for take in takes)]
    floors = takes_noise(takes, measured)
    if any(name not in floors for name in measured):
        return None
    known = {name: (floors[name].floor_deg, floors[name].low_deg, floors[name].high_deg) for name in measured}
    return FloorBand.of(known)
