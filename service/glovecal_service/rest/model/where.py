"""``models/{id}/where``: where a model fails, what the error depends on, and how small it could get."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from pydantic import BaseModel, Field

from glovecal_models.comparison.residuals import residuals
from glovecal_models.comparison.where_it_fails import where_it_fails
from glovecal_service.plain import plain
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.comparison import Against, Floor, chosen

router = APIRouter(prefix="/models", tags=["models"])


class SlowShareView(BaseModel):
    share: float | None = Field(description="Share of the error's variance below 1 Hz.")
    low: float | None = Field(description="95 % interval, from resampled blocks of time.")
    high: float | None


class DependenceView(BaseModel):
    covariate: str
    unit: str
    phrase: str
    edges: list[float | None]
    mean_deg: list[float | None] = Field(description="Mean error in each bin.")
    count: list[int]
    chance_deg: list[float | None] = Field(
        description="How far 95 % of the time shifts take a bin's mean from the mean of all."
    )
    explained_deg: float | None
    probability: float | None = Field(description="Share of time shifts that explain as much.")
    is_structure: bool = Field(description="No noise, and large enough to matter.")


class WearingsView(BaseModel):
    rotation: str
    wearings: list[str]
    mean_deg: list[float | None]
    takes: list[int]
    spread_deg: float | None
    probability: float | None = Field(description="Null: too few takes to say.")
    sentence: str


class Findings(BaseModel):
    rotation: str
    rmse_deg: float | None
    bias_deg: float | None
    floor: Floor | None
    other_floors: list[Floor] = Field(description="Less good estimates of the floor.")
    slow: SlowShareView | None
    dependences: list[DependenceView]
    wearings: WearingsView | None
    sentence: str


class StretchView(BaseModel):
    take: str
    start_s: float
    end_s: float
    rmse_deg: float | None
    rotation: str
    rotation_rmse_deg: float | None
    pose: str


class WhereView(BaseModel):
    model: str
    rotations: list[Findings] = Field(description="The one farthest above its noise floor first.")
    stretches: list[StretchView] = Field(description="The worst seconds, worst first.")
    trained_on: list[str] = Field(description="Takes among those given that the model was trained on.")


@router.post(
    "/{id}/where",
    response_model=WhereView,
    summary="Where the model fails",
    responses=change_problems(409),
)
def where_model_fails(id: ModelInPath, body: Against, parts: PartsNeeded) -> dict[str, Any]:
    """Noise floor, what each error depends on (against chance), wearings, and the worst seconds."""
    record, model, wanted, seen = chosen(id, body, parts)
    found = residuals(model, [parts.store.takes.load(take) for take in wanted])
    document = plain(where_it_fails(found).to_document())
    return document | {"model": record.id, "trained_on": seen}
