"""The picture of an effect in a model's error, as an answer gives its points."""

from __future__ import annotations

from dataclasses import asdict

from pydantic import BaseModel, Field

from glovecal_models.comparison.effect_picture import EffectPicture
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_service.plain import plain
from glovecal_service.views.noise_floor import NoiseFloorView


class PictureSeriesView(BaseModel):
    name: str = Field(description='Such as "angle rising"; "" for a line that is alone.')
    at: list[float] = Field(description="On the axis; the category's number where there are categories.")
    mean_deg: list[float | None]
    low_deg: list[float | None] = Field(description="10 % of the frames there are lower.")
    high_deg: list[float | None]
    chance_deg: list[float | None] = Field(
        description="How far 95 % of circularly shifted errors take such a mean; null: not tested."
    )
    points_at: list[float] = Field(description="Of single frames, or takes, evenly chosen.")
    points_deg: list[float]


class EffectPictureView(BaseModel):
    model: str
    effect: str
    shown_over: str = Field(description="What the effect declares.")
    rotation: str
    rotations: list[str] = Field(description="All that these takes measured.")
    axis: str
    unit: str
    value: str = Field(description="What is drawn upwards, in degrees.")
    categories: list[str] = Field(description="Places on an axis without numbers; empty: numbers.")
    series: list[PictureSeriesView] = Field(description="Empty: these takes have nothing to draw it from.")
    floor: NoiseFloorView | None = Field(description="Of the rotation's error on these takes.")
    sentence: str


def effect_picture_view(
    picture: EffectPicture,
    model: str,
    effect: str,
    shown_over: str,
    *,
    rotations: tuple[str, ...],
    floor: NoiseFloor | None,
) -> EffectPictureView:
    return EffectPictureView(
        model=model,
        effect=effect,
        shown_over=shown_over,
        rotation=picture.rotation,
        rotations=list(rotations),
        axis=picture.axis,
        unit=picture.unit,
        value=picture.value,
        categories=list(picture.categories),
        series=[PictureSeriesView.model_validate(plain(asdict(one))) for one in picture.series],
        floor=None if floor is None else NoiseFloorView.of(floor),
        sentence=picture.sentence,
    )
