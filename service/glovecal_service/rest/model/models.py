"""``models``: calibration models, their versions, and what they predict."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from fastapi import APIRouter, Response
from pydantic import Field

from glovecal_models.calibration.answer import ModelEffect
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.text import model_effect, wearing_sentences
from glovecal_models.errors import DamagedArtifact
from glovecal_models.hand.rotations import Handedness
from glovecal_models.regression.kernel_candidates import CANDIDATE
from glovecal_models.regression.kernel_scores import choice_of
from glovecal_models.regression.linear_regressor import LinearRegressor, gains_of
from glovecal_models.regression.regressor import Regressor
from glovecal_service.plain import document_of, plain, plain_text, read
from glovecal_service.request_types import Identifier, StrictBody, SubjectName
from glovecal_service.rest.http.dependencies import PartsNeeded, StoreNeeded
from glovecal_service.rest.http.list_part import ByTime, InParts
from glovecal_service.rest.http.problem import change_problems, problems, warn_of_damaged
from glovecal_service.rest.http.request_types import HandFilter, LayoutFilter, ModelInPath, SubjectFilter
from glovecal_service.rest.model.answer import (
    ActivationView,
    KernelChoiceView,
    KernelScoreView,
    LineView,
    Model,
    ModelInFull,
    Rotation,
    UnseenWearingView,
)
from glovecal_service.store import tables
from glovecal_service.store.records import NAME, NOTE, Activation, ModelRecord

router = APIRouter(prefix="/models", tags=["models"])


class Which(StrictBody):
    subject: SubjectName
    layout: Identifier
    hand: Handedness | None = Field(None, description="Needed where both hands have a model of their own.")


@router.get("", response_model=list[Model], summary="Models, oldest first", responses=problems())
def list_models(
    store: StoreNeeded,
    paging: ByTime,
    subject: SubjectFilter = None,
    layout: LayoutFilter = None,
    hand: HandFilter = None,
    removed: bool = False,
) -> list[Model]:
    """Damaged rows are left out and named in `Warning` headers. `removed`: those that were removed. More than
    `limit`: see `Link`."""
    page = store.models.page(paging.part, subject=subject, layout=layout, hand=hand, removed=removed)
    records = paging.answer(page)
    active, damaged_activations = store.models.active_among(records)
    warn_of_damaged(paging.response, damaged_activations)
    damaged = store.damages.of_models([record.id for record in records])
    return [model_row(record, record.id in active, damaged.get(record.id, "")) for record in records]


@router.post(
    "/rollback",
    response_model=ActivationView,
    summary="Return to the model that was active before",
    responses=change_problems(409),
)
def roll_back(body: Which, store: StoreNeeded) -> Activation:
    """Again: to the one before that. 409 when nothing earlier was active."""
    store.subjects.get(body.subject)
    return store.models.rollback(body.subject, body.layout, body.hand)


@router.get("/{id}", response_model=ModelInFull, summary="One model", responses=problems(409))
def get_model(id: ModelInPath, parts: PartsNeeded) -> ModelInFull:
    record = parts.store.models.get(id)
    if damage := parts.store.models.damage(record):
        parts.store.damages.note(tables.models.name, record.id, damage, record.subject)
        raise DamagedArtifact(damage)
    model, _ = parts.predictors.get(record.id)
    return model_in_full(record, parts.store.models.is_active(record), model)


class Described(StrictBody):
    name: Annotated[str, Field(max_length=80)]
    note: Annotated[str, Field(max_length=2000)] = ""


@router.put("/{id}/name", response_model=Model, summary="Name a model", responses=change_problems(409))
def describe_model(id: ModelInPath, body: Described, store: StoreNeeded) -> Model:
    """What people call it, and what they want to remember of it."""
    record = store.models.describe(id, name=plain_text(body.name), note=plain_text(body.note))
    return model_row(record, store.models.is_active(record))


@router.delete("/{id}", response_model=Model, summary="Remove a model", responses=change_problems(409))
def remove_model(id: ModelInPath, store: StoreNeeded) -> Model:
    """It is left out of lists; what was made of it stays, and `restore` undoes it. 409 for an active one."""
    return model_row(store.models.remove(id), active=False)


@router.post(
    "/{id}/restore", response_model=Model, summary="Undo the removal", responses=change_problems(409)
)
def restore_model(id: ModelInPath, store: StoreNeeded) -> Model:
    return model_row(store.models.restore(id), active=False)


@router.get(
    "/{id}/lineage",
    response_model=list[Model],
    summary="The model, its parent, the parent's parent ...",
    responses=problems(409),
)
def get_lineage(id: ModelInPath, store: StoreNeeded, paging: InParts) -> list[Model]:
    line = paging.part_of(store.models.lineage(id), lambda record: record.id)
    active, _ = store.models.active_among(line)
    return [model_row(record, record.id in active) for record in line]


@router.post(
    "/{id}/activate",
    response_model=ActivationView,
    summary="Predict live with this model",
    responses=change_problems(409),
)
def activate_model(id: ModelInPath, store: StoreNeeded) -> Activation:
    """From the next frame on. A damaged artifact is refused and what was active stays so."""
    return store.models.activate(id)


@router.get(
    "/{id}/export",
    response_class=Response,
    summary="The model's artifact",
    responses=problems(409)
    | {
        200: {
            "description": "safetensors, its manifest inside; its sha256 is the model's id.",
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
def export_model(id: ModelInPath, store: StoreNeeded) -> Response:
    record = store.models.get(id)
    name = f"{record.subject}-{record.layout}-{record.id[:12]}.safetensors"
    return Response(
        store.models.load_bytes(record.id),
        media_type="application/octet-stream",
        headers={"Content-Disposition": f'attachment; filename="{name}"', "ETag": f'"{record.id}"'},
    )


def model_row(record: ModelRecord, active: bool, damage: str = "") -> Model:
    known = {name: plain(record.facts.get(name)) for name in ("held_out_rmse_deg", "rmse_unseen_wearing_deg")}
    effects = list(record.facts.get("effects", ()))
    named = {key: record.facts.get(key, "") for key in (NAME, NOTE)}
    own = {**vars(record), **named, "facts": plain(record.facts), "effects": effects}
    return Model(**own, **known, active=active, damage=damage or None)


def model_in_full(record: ModelRecord, active: bool, model: CalibrationModel) -> ModelInFull:
    """With what the artifact itself holds. Raises pydantic.ValidationError for a strange one."""
    row = dict(model_row(record, active))
    row |= {
        "effects": [item.name for item in model.effects],
        "held_out_rmse_deg": plain(model.error_estimate.get("rmse_deg")),
    }
    return ModelInFull(
        **row,
        rotations=[_rotation(item) for item in model.rotations],
        effect_details=[read(ModelEffect, document_of(model_effect(item))) for item in model.effects],
        simulated=model.simulated,
        error_estimate=plain(model.error_estimate),
        unseen_wearing=_unseen_wearing(model),
    )


def _unseen_wearing(model: CalibrationModel) -> UnseenWearingView | None:
    """None: an older model."""
    found = model.unseen_wearing
    if found is None:
        return None
    known = {name: getattr(found, name) for name in UnseenWearingView.model_fields if hasattr(found, name)}
    seen_deg = model.error_estimate.get("rmse_deg")
    own = {"rmse_unseen_wearing_deg": found.rmse_deg, "rmse_deg": seen_deg}
    return UnseenWearingView(**plain(known | own), sentences=wearing_sentences(model, seen_deg))


def _rotation(item: RotationModel) -> Rotation:
    return Rotation(
        rotation=item.rotation,
        kind=item.correspondence.kind,
        sensors=list(item.correspondence.sensors),
        method=item.regressor.method,
        held_out_rmse_deg=plain(item.held_out_rmse_deg),
        noise_deg=plain(float(np.sqrt(item.regressor.noise_variance))),
        uncertain_above_deg=item.uncertain_above_deg,
        samples=item.samples,
        kernel_choice=_kernel_choice(item.rotation, item.regressor),
        line=_line(item),
    )


def _kernel_choice(rotation: str, regressor: Regressor) -> KernelChoiceView | None:
    """None when nothing was chosen."""
    found = choice_of(regressor)
    if found is None:
        return None
    return KernelChoiceView(
        sentence=found.sentence(rotation),
        samples=found.samples,
        straight_line_deg=plain(found.straight_line_deg),
        spread_deg=plain(found.spread_deg),
        candidates=[
            KernelScoreView(
                kernel=item.name,
                words=CANDIDATE[item.name].words,
                chosen=item is found.chosen,
                nlml=plain(item.nlml),
                evidence_gain=plain(found.evidence_gain(item)),
                held_out_rmse_deg=plain(item.held_out_rmse_deg),
            )
            for item in found.scores
        ],
    )


def _line(item: RotationModel) -> LineView | None:
    if not isinstance(item.regressor, LinearRegressor):
        return None
    gains, offset = gains_of(item.regressor)
    return LineView(
        scale_deg=dict(zip(item.correspondence.inputs, gains.tolist(), strict=True)), offset_deg=offset
    )
