"""``models``: calibration models, their versions, and what they predict."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Response
from pydantic import BaseModel, Field, FiniteFloat

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.errors import LayoutMismatch
from glovecal_service.plain import plain
from glovecal_service.rest.answers import change_problems, problems
from glovecal_service.rest.dependencies import PartsNeeded, StoreNeeded
from glovecal_service.rest.names import Channel, Identifier, LayoutFilter, ModelInPath, SubjectFilter
from glovecal_service.rest.strict_body import StrictBody
from glovecal_service.store.records import Activation, ModelRecord

router = APIRouter(prefix="/models", tags=["models"])

MOST_FRAMES = 20_000
MOST_SENSORS = 512


class Model(BaseModel):
    id: str = Field(description="sha256 of the artifact.")
    subject: str
    layout: str
    method: str
    parent: str | None
    active: bool = Field(
        description="Whether live frames of the subject with the layout are predicted by it."
    )
    held_out_rmse_deg: float | None = Field(description="Error on takes left out of training, degrees.")
    facts: dict[str, Any] = Field(description="Takes trained on, errors, how long it took ...")
    created_at: datetime


class Rotation(BaseModel):
    rotation: str
    kind: str = Field(description="1S1R, MS1R, 0S1R or MSMR.")
    sensors: list[str]
    method: str
    held_out_rmse_deg: float | None
    noise_deg: float | None = Field(description="Standard deviation of the measurement noise.")
    uncertain_above_deg: float
    samples: int


class ModelEffect(BaseModel):
    effect: str
    explanation: str
    where: list[str] = Field(description="Rotations that it corrects.")
    parameters: dict[str, dict[str, float | None]] = Field(
        description="For each rotation, units in the names."
    )
    evidence: dict[str, Any] = Field(description="What it saved when it was added.")
    declaration: dict[str, Any] | None = Field(description="Of a user's own effect.")


class ModelInFull(Model):
    rotations: list[Rotation]
    effects: list[ModelEffect] = Field(description="In the order in which they were added.")
    simulated: bool = Field(description="Whether any training take came from a simulated glove.")
    error_estimate: dict[str, Any]


class ActivationView(BaseModel):
    id: int
    subject: str
    layout: str
    model: str
    kind: Literal["activate", "rollback"]
    previous: int | None
    created_at: datetime


class Which(StrictBody):
    subject: Identifier
    layout: Identifier


class Readings(StrictBody):
    readings: Annotated[
        list[Annotated[list[FiniteFloat], Field(max_length=MOST_SENSORS)]],
        Field(min_length=1, max_length=MOST_FRAMES, description="Frames of raw readings."),
    ]
    sensors: Annotated[list[Channel], Field(max_length=MOST_SENSORS)] | None = Field(
        None, description="Order of the readings; None: that of the model's layout."
    )


class Angles(BaseModel):
    model: str
    rotations: list[str]
    mean_deg: list[list[float | None]]
    sd_deg: list[list[float | None]] = Field(description="Of the rotation with its measurement noise.")
    flags: list[list[int]] = Field(description="Sum of 1 extrapolating, 2 too uncertain, 4 by rule.")


@router.get("", response_model=list[Model], summary="Models, oldest first", responses=problems())
def list_models(
    store: StoreNeeded, subject: SubjectFilter = None, layout: LayoutFilter = None
) -> list[dict[str, Any]]:
    records = store.models.list(subject=subject, layout=layout)
    pairs = {(record.subject, record.layout) for record in records}
    active = {record.id for pair in pairs if (record := store.models.active(*pair)) is not None}
    return [_row(record, record.id in active) for record in records]


@router.post(
    "/rollback",
    response_model=ActivationView,
    summary="Return to the model that was active before",
    responses=change_problems(409),
)
def roll_back(body: Which, store: StoreNeeded) -> Activation:
    """Again: to the one before that. 409 when nothing earlier was active."""
    store.subjects.get(body.subject)
    return store.models.rollback(body.subject, body.layout)


@router.get("/{id}", response_model=ModelInFull, summary="One model", responses=problems(409))
def get_model(id: ModelInPath, parts: PartsNeeded) -> dict[str, Any]:
    record = parts.store.models.get(id)
    active = parts.store.models.active(record.subject, record.layout)
    model, _ = parts.predictors.get(record.id)
    return _row(record, active is not None and active.id == record.id) | {
        "rotations": [_rotation(item) for item in model.rotations],
        "effects": [_effect(item) for item in model.effects],
        "simulated": model.simulated,
        "error_estimate": plain(model.error_estimate),
        "held_out_rmse_deg": plain(model.error_estimate.get("rmse_deg")),
    }


@router.get(
    "/{id}/lineage",
    response_model=list[Model],
    summary="The model, its parent, the parent's parent ...",
    responses=problems(409),
)
def get_lineage(id: ModelInPath, store: StoreNeeded) -> list[dict[str, Any]]:
    line = store.models.lineage(id)
    active = store.models.active(line[0].subject, line[0].layout)
    return [_row(record, active is not None and active.id == record.id) for record in line]


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
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


@router.post(
    "/{id}/predict",
    response_model=Angles,
    summary="Rotations of given readings",
    responses=change_problems(409),
)
def predict(id: ModelInPath, body: Readings, parts: PartsNeeded) -> dict[str, Any]:
    """For trying a model out; the live stream goes over zenoh. 422 when the sensors are not the model's."""
    record = parts.store.models.get(id)
    model, predictor = parts.predictors.get(record.id)
    angles = predictor.predict(_in_model_order(body, model))
    parts.metrics.predicted_frames.inc(len(body.readings))
    return {
        "model": record.id,
        "rotations": list(predictor.rotations),
        "mean_deg": plain(angles.mean),
        "sd_deg": plain(angles.sd),
        "flags": angles.flags.tolist(),
    }


def _row(record: ModelRecord, active: bool) -> dict[str, Any]:
    row = {**record.__dict__, "active": active, "facts": plain(record.facts)}
    return row | {"held_out_rmse_deg": plain(record.facts.get("held_out_rmse_deg"))}


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
    }


def _effect(item: AddedEffect) -> dict[str, Any]:
    return plain(
        {
            "effect": item.name,
            "explanation": item.effect.explanation,
            "where": item.active,
            "parameters": item.described() if item.weights.shape[1] else {},
            "evidence": item.evidence,
            "declaration": item.settings.get("declaration"),
        }
    )


def _in_model_order(body: Readings, model: CalibrationModel) -> np.ndarray:
    wanted = model.layout.sensors
    given = tuple(body.sensors) if body.sensors is not None else wanted
    missing = [name for name in wanted if name not in given]
    if missing:
        raise LayoutMismatch(f"no readings of sensor {missing[0]!r}, which the model's layout needs")
    for number, frame in enumerate(body.readings):
        if len(frame) != len(given):
            raise LayoutMismatch(
                f"frame {number} has {len(frame)} readings, but there are {len(given)} sensors: "
                f"{', '.join(given)}"
            )
    return np.array(body.readings, dtype=float)[:, [given.index(name) for name in wanted]]
