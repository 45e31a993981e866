"""``models/{id}/series``: measured, predicted and error of one rotation over time, to be drawn."""

from __future__ import annotations

import math
from typing import Annotated

from fastapi import APIRouter
from pydantic import Field, FiniteFloat

from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import Channel, ModelInPath, StrictBody
from glovecal_service.rest.model.compared_takes import compared_takes
from glovecal_service.rest.model.model_takes import TakesNamed
from glovecal_service.views.series import SeriesView, series_view

router = APIRouter(prefix="/models", tags=["models"])


class Series(StrictBody):
    takes: TakesNamed
    rotation: Channel
    from_s: FiniteFloat | None = Field(None, description="Begin of a window on the linked axis; null: all.")
    to_s: FiniteFloat | None = Field(None, description="Its end.")
    points: Annotated[int, Field(ge=100, le=4000)] = Field(2000, description="At most, over all takes.")


@router.post(
    "/{id}/series",
    response_model=SeriesView,
    summary="One rotation over time: measured, predicted, error",
    responses=change_problems(409),
)
def series_of_rotation(id: ModelInPath, body: Series, parts: PartsNeeded) -> SeriesView:
    """Takes after one another on a linked axis. Where there are more frames than points, the lowest and the
    highest of measured, predicted and error are kept in every part of the window.

    A take has at least 20 points where it has so many frames in the window.
    """
    on = compared_takes(id, body.takes, body.rotation, parts)
    window = (-math.inf if body.from_s is None else body.from_s, math.inf if body.to_s is None else body.to_s)
    return series_view(
        on.found, on.takes, on.model.id, body.rotation,
        window_s=window, points=body.points, trained_on=on.trained_on,
    )  # fmt: skip
