"""``models/{id}/effect-picture``: a model's error drawn over what shows one effect."""

from __future__ import annotations

import numpy as np
from fastapi import APIRouter
from pydantic import Field

from glovecal_models.comparison.effect_picture import effect_picture
from glovecal_models.comparison.noise_floor import noise_floors
from glovecal_service.plain import plain
from glovecal_service.questions.chosen_takes import TakesNamed
from glovecal_service.questions.declarations import AskedEffect, asked_effect
from glovecal_service.request_types import Channel, StrictBody
from glovecal_service.rest.effect.answer import EffectPictureView, PictureSeriesView
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.comparison import compared_takes

router = APIRouter(prefix="/models", tags=["models"])


class PictureRequest(StrictBody):
    effect: AskedEffect
    takes: TakesNamed
    rotation: Channel | None = Field(None, description="Null: the one with the largest error.")


@router.post(
    "/{id}/effect-picture",
    response_model=EffectPictureView,
    summary="The error drawn over what shows an effect",
    responses=change_problems(409),
)
def picture_of_effect(id: ModelInPath, body: PictureRequest, parts: PartsNeeded) -> EffectPictureView:
    """Each effect declares over what: the angle (both ways, where direction matters), speed, time at rest,
    wearing, take, a neighbour's reading, a context column, or shifts of the clock.

    The model need not have the effect: of one that has it, the picture shows what the effect left over.
    """
    on = compared_takes(id, body.takes, body.rotation, parts)
    model, _ = parts.predictors.get(on.model.id)
    effect = asked_effect(body.effect, model, on.takes)
    measured = on.found.measured_rotations
    errors = np.sqrt(np.nanmean(on.found.stacked("error") ** 2, axis=0))
    rotation = body.rotation or max(measured, key=lambda name: errors[on.found.column(name)])
    picture = dict(vars(effect_picture(on.found, effect, rotation)))
    series = [PictureSeriesView(**plain(vars(one))) for one in picture.pop("series")]
    return EffectPictureView(
        **picture,
        series=series,
        model=on.model.id,
        effect=effect.name,
        shown_over=effect.about.shown_over,
        rotations=list(measured),
        floor=noise_floors(on.found).get(rotation),
    )
