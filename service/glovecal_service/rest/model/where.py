"""``models/{id}/where``: where a model fails, what the error depends on, and how small it could get."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.comparison.cross_validation_difference import cross_validation_difference
from glovecal_models.comparison.residuals import residuals
from glovecal_models.comparison.where_it_fails import where_it_fails
from glovecal_service.jobs.ceiling import known_ceiling
from glovecal_service.jobs.model_work import trained_ids
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.comparison import Against, chosen
from glovecal_service.views.failures import FailuresView, failures_view, with_cross_validation

router = APIRouter(prefix="/models", tags=["models"])


class Failures(Against):
    cross_validation: bool = Field(
        default=False, description="Also compare two models trained on disjoint halves of the training takes."
    )


@router.post(
    "/{id}/where",
    response_model=FailuresView,
    summary="Where the model fails",
    responses=change_problems(409),
)
def where_model_fails(id: ModelInPath, body: Failures, parts: PartsNeeded) -> FailuresView:
    """Noise floor, what each error depends on (against chance), wearings, and the worst seconds.

    With `cross_validation` two models are trained on disjoint halves of the training takes and compared.
    """
    record, model, wanted, seen = chosen(id, body, parts)
    found = residuals(model, [parts.store.takes.load(take) for take in wanted])
    view = failures_view(where_it_fails(found), record.id, seen, known_ceiling(parts.store, record))
    if not body.cross_validation:
        return view
    takes = [parts.store.takes.load(id) for id in trained_ids(parts.store, record)]
    return with_cross_validation(view, cross_validation_difference(model, takes))
