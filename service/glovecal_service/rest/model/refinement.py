"""``models/{id}/refine``: scale and offset of single rotations, turned by hand; every change is a version."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.refinement import (
    LARGEST_OFFSET_DEG,
    LEAST_SCALE,
    MOST_SCALE,
    Refinement,
    refined,
)
from glovecal_service.request_types import Channel, StrictBody
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.answer import Model
from glovecal_service.rest.model.models import model_row

router = APIRouter(prefix="/models", tags=["models"])

MOST_ROTATIONS = 64


class RefinementBody(StrictBody):
    scale: float = Field(1.0, ge=LEAST_SCALE, le=MOST_SCALE, description="Times the angle.")
    offset_deg: float = Field(
        0.0, ge=-LARGEST_OFFSET_DEG, le=LARGEST_OFFSET_DEG, description="Added after it, degrees."
    )


class Refine(StrictBody):
    rotations: dict[Channel, RefinementBody] = Field(min_length=1, max_length=MOST_ROTATIONS)
    activate: bool = Field(False, description="Predict live with the child at once.")


@router.post(
    "/{id}/refine",
    status_code=201,
    response_model=Model,
    summary="Refine scale and offset by hand",
    responses=change_problems(409),
)
def refine_model(id: ModelInPath, body: Refine, parts: PartsNeeded) -> Model:
    """Only rotations that are lines (raw, linear, two_shapes, template) and that no effect corrects.

    The model stays; its child has the same takes and an unknown held-out error. Take it back with
    `models/rollback`, where it was activated.
    """
    store = parts.store
    record = store.models.get(id)
    model, _ = parts.predictors.get(record.id)
    changes = {name: Refinement(each.scale, each.offset_deg) for name, each in body.rotations.items()}
    child = refined(model, changes, record.id)
    told = ", ".join(
        f"{name} times {each.scale:.3g} {each.offset_deg:+.1f} degrees" for name, each in changes.items()
    )
    found = store.models.add(
        dump(child),
        subject=record.subject,
        layout=record.layout,
        method=record.method,
        parent=record.id,
        facts={key: value for key, value in record.facts.items() if key in ("takes", "simulated")}
        | {
            "held_out_rmse_deg": None,
            "rmse_unseen_wearing_deg": None,
            "held_out_how": child.error_estimate["how"],
            "per_rotation": {item.rotation: item.held_out_rmse_deg for item in child.rotations},
            "sentences": [f"Refined by hand: {told}. Its error was not measured."],
        },
    )
    if body.activate:
        store.models.activate(found.id)
    return model_row(found, body.activate)
