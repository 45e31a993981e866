"""Effects of the catalogue and their pictures as REST gives them."""

from __future__ import annotations

from pydantic import Field

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.effects.base.facts import Kind
from glovecal_service.plain import Row


class ParameterView(Row):
    name: str
    unit: str
    low: float | None
    high: float | None
    prior: str = Field(description="What is known before any measurement.")


class CatalogueEffect(Row):
    name: str
    explanation: str
    kind: Kind = Field(
        description="correction: adds to the prediction; repair: mends the reference; interval: widens "
        "the claimed standard deviation; finding: says where a recording lost something; nothing: the null "
        "hypothesis."
    )
    can_be_added: bool = Field(description="Whether `models/{id}/effects` takes it.")
    parameters: list[ParameterView] = Field(description="What is searched for beside weights.")
    context: list[str] = Field(description="Context columns (`c.NAME`) it needs.")
    has_memory: bool
    control: str = Field(
        description="How its negative control is made: columns with the same freedom that cannot be right."
    )
    source: str
    own: bool = Field(description="Brought by a package of the user's own.")
    package: str


class SchematicView(Row):
    """Shapes are real, sizes exaggerated."""

    time_s: list[float]
    without: list[float | None] = Field(description="The reading, or the measured angle, without the effect.")
    with_effect: list[float | None]
    label: str = Field(description="reading, or measured angle.")
    time_label: str


class PictureSeriesView(Row):
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


class EffectPictureView(Row):
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
    floor: NoiseFloor | None = Field(description="Of the rotation's error on these takes.")
    sentence: str
