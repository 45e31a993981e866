"""``models/{id}/where``: where a model fails, what the error depends on, and how small it could get."""

from __future__ import annotations

from fastapi import APIRouter

from glovecal_models.comparison.residuals import residuals
from glovecal_models.comparison.where_it_fails import where_it_fails
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.comparison import Against, chosen
from glovecal_service.views.failures import FailuresView, failures_view

router = APIRouter(prefix="/models", tags=["models"])


@router.post(
    "/{id}/where",
    response_model=FailuresView,
    summary="Where the model fails",
    responses=change_problems(409),
)
def where_model_fails(id: ModelInPath, body: Against, parts: PartsNeeded) -> FailuresView:
    """Noise floor, what each error depends on (against chance), wearings, and the worst seconds."""
    record, model, wanted, seen = chosen(id, body, parts)
    found = residuals(model, [parts.store.takes.load(take) for take in wanted])
    return failures_view(where_it_fails(found), record.id, seen)
