"""``models``: calibration models, their versions, and what they predict."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

import numpy as np
from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.errors import DamagedArtifact
from glovecal_models.hand.handedness import Handedness, is_of_hand
from glovecal_models.regression.known_line import gains_of
from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_service.plain import plain
from glovecal_service.rest.http.answers import change_problems, problems
from glovecal_service.rest.http.damaged_rows import warn, without_damaged
from glovecal_service.rest.http.dependencies import PartsNeeded, StoreNeeded
from glovecal_service.rest.http.request_types import (
    HandFilter,
    Identifier,
    LayoutFilter,
    ModelInPath,
    StrictBody,
    SubjectFilter,
    SubjectName,
)
from glovecal_service.store.errors import StoreDamaged
from glovecal_service.store.records import Activation, ModelRecord
from glovecal_service.views.training import EffectView, KernelChoiceView, effect_view, kernel_view
from glovecal_service.views.unseen_wearing import UnseenWearingView, unseen_wearing_view

router = APIRouter(prefix="/models", tags=["models"])


class Model(BaseModel):
    id: str = Field(description="sha256 of the artifact.")
    subject: str
    layout: str
    method: str
    parent: str | None
    hand: Handedness | None = Field(
        description="That of the takes it was trained on: a subject's gloves have models of their own. Null: "
        "nobody said it, and it reads both."
    )
    active: bool = Field(
        description="Whether live frames of the subject with the layout are predicted by it."
    )
    damage: str | None = Field(
        description="Of an active model in a list: why its artifact cannot be loaded, and what to do."
    )
    held_out_rmse_deg: float | None = Field(description="Error on takes left out of training, degrees.")
    rmse_unseen_wearing_deg: float | None = Field(
        description="Error in a wearing not seen in training, degrees; null: one wearing only, or unknown."
    )
    effects: list[str] = Field(description="Names of its effects, in the order in which they were added.")
    facts: dict[str, Any] = Field(description="Takes trained on, errors, how long it took ...")
    created_at: datetime


class LineView(BaseModel):
    """angle = offset_deg + the sum of scale times reading (Krnoul et al. 2016, Figure 1)."""

    scale_deg: dict[str, float] = Field(description="Degrees a count, by what is read.")
    offset_deg: float = Field(description="The angle at reading zero.")


class Rotation(BaseModel):
    rotation: str
    kind: str = Field(description="1S1R, MS1R, 0S1R or MSMR.")
    sensors: list[str]
    method: str
    held_out_rmse_deg: float | None
    noise_deg: float | None = Field(description="Standard deviation of the measurement noise.")
    uncertain_above_deg: float
    samples: int
    kernel_choice: KernelChoiceView | None = Field(description="Of a model trained with `auto`, else null.")
    line: LineView | None = Field(description="Of a linear rotation or a template's equation, else null.")


class ModelInFull(Model):
    rotations: list[Rotation]
    effect_details: list[EffectView]
    simulated: bool = Field(description="Whether any training take came from a simulated glove.")
    error_estimate: dict[str, Any]
    unseen_wearing: UnseenWearingView | None = Field(description="Null for a model of an earlier version.")


class ActivationView(BaseModel):
    id: int
    subject: str
    layout: str
    model: str
    kind: Literal["activate", "rollback"]
    previous: int | None
    created_at: datetime


class Which(StrictBody):
    subject: SubjectName
    layout: Identifier
    hand: Handedness | None = Field(None, description="Needed where both hands have a model of their own.")


@router.get("", response_model=list[Model], summary="Models, oldest first", responses=problems())
def list_models(
    store: StoreNeeded,
    response: Response,
    subject: SubjectFilter = None,
    layout: LayoutFilter = None,
    hand: HandFilter = None,
) -> list[dict[str, Any]]:
    """Damaged rows are left out and named in `Warning` headers."""
    every = without_damaged(response, lambda: store.models.list(subject=subject, layout=layout))
    records = [record for record in every if is_of_hand(record.hand, hand)]
    active = set()
    for pair in sorted({(record.subject, record.layout) for record in records}):
        try:
            active |= {found.id for found in store.models.active_of_each_hand(*pair)}
        except StoreDamaged as error:
            warn(response, str(error))
    return [
        model_row(record, record.id in active, store.models.damage(record) if record.id in active else "")
        for record in records
    ]


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
def get_model(id: ModelInPath, parts: PartsNeeded) -> dict[str, Any]:
    record = parts.store.models.get(id)
    if damage := parts.store.models.damage(record):
        raise DamagedArtifact(damage)
    model, _ = parts.predictors.get(record.id)
    return model_row(record, parts.store.models.is_active(record)) | model_details(model)


@router.get(
    "/{id}/lineage",
    response_model=list[Model],
    summary="The model, its parent, the parent's parent ...",
    responses=problems(409),
)
def get_lineage(id: ModelInPath, store: StoreNeeded) -> list[dict[str, Any]]:
    line = store.models.lineage(id)
    return [model_row(record, store.models.is_active(record)) for record in line]


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


def model_row(record: ModelRecord, active: bool, damage: str = "") -> dict[str, Any]:
    """As ``Model`` shows it."""
    effects = list(record.facts.get("effects", ()))
    row = {
        **record.__dict__,
        "active": active,
        "effects": effects,
        "facts": plain(record.facts),
    }
    row["damage"] = damage or None
    return row | {
        name: plain(record.facts.get(name)) for name in ("held_out_rmse_deg", "rmse_unseen_wearing_deg")
    }


def model_details(model: CalibrationModel) -> dict[str, Any]:
    """What ``ModelInFull`` shows of the artifact itself."""
    return {
        "rotations": [_rotation(item) for item in model.rotations],
        "effects": [item.name for item in model.effects],
        "effect_details": [effect_view(item) for item in model.effects],
        "simulated": model.simulated,
        "error_estimate": plain(model.error_estimate),
        "held_out_rmse_deg": plain(model.error_estimate.get("rmse_deg")),
        "unseen_wearing": unseen_wearing_view(model),
    }


def _rotation(item: RotationModel) -> dict[str, Any]:
    return {
        "rotation": item.rotation,
        "kind": item.correspondence.kind,
        "sensors": list(item.correspondence.sensors),
        "method": item.regressor.method,
        "held_out_rmse_deg": plain(item.held_out_rmse_deg),
        "noise_deg": plain(float(np.sqrt(item.regressor.noise_variance))),
        "uncertain_above_deg": item.uncertain_above_deg,
        "samples": item.samples,
        "kernel_choice": kernel_view(item.rotation, item.regressor),
        "line": _line(item),
    }


def _line(item: RotationModel) -> dict[str, Any] | None:
    if not isinstance(item.regressor, LinearRegressor):
        return None
    gains, offset = gains_of(item.regressor)
    return {
        "scale_deg": dict(zip(item.correspondence.inputs, gains.tolist(), strict=True)),
        "offset_deg": offset,
    }
