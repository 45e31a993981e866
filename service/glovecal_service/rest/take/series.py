"""``takes/{id}/series``: a take as it is drawn."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from fastapi.responses import JSONResponse

from glovecal_models.takes.answer import TakeSeries
from glovecal_models.takes.take_series import take_series
from glovecal_service.plain import document_of
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.problem import problems
from glovecal_service.rest.http.request_types import IdInPath

router = APIRouter(prefix="/takes", tags=["takes"])


@router.get(
    "/{id}/series",
    response_model=TakeSeries,
    summary="Readings and reference over time, as they are drawn",
    responses=problems(),
)
def get_series(
    id: IdInPath,
    store: StoreNeeded,
    from_s: Annotated[float | None, Query(ge=0, description="Seconds since its first frame.")] = None,
    to_s: Annotated[float | None, Query(ge=0)] = None,
    points: Annotated[int, Query(ge=100, le=20_000, description="Frames at most, and rows.")] = 2000,
) -> JSONResponse:
    """Of many frames those that hold each sensor's lowest and highest reading: no extreme is lost."""
    take = store.takes.load_recorded(id)
    return JSONResponse(document_of(take_series(take, from_s=from_s, to_s=to_s, points=points)))
