"""How the error fell down to a model, as an answer gives it."""

from __future__ import annotations

from pydantic import BaseModel, Field

from glovecal_service.views.diagnosis import TakeNamed


class FallStepView(BaseModel):
    label: str = Field(description="What is new: a method, or effects with + and -.")
    model: str | None = Field(description="The version's id; null: a simpler calibration, there for scale.")
    effects: list[str] = Field(description="All of the version.")
    rmse_deg: float = Field(description="Over all rotations.")
    control_rmse_deg: float | None = Field(
        description="With the control of the newest effect in its place; null: not known."
    )


class FloorBandView(BaseModel):
    floor_deg: float
    low_deg: float = Field(description="95 % interval.")
    high_deg: float


class FallView(BaseModel):
    model: str
    steps: list[FallStepView] = Field(description="Simpler calibrations, then the versions, oldest first.")
    floor: FloorBandView | None = Field(description="Over all rotations.")
    takes: list[TakeNamed] = Field(description="The errors are on these.")
    is_held_out: bool = Field(
        description="Whether no version was trained on any of them; else each error is of folds held out of "
        "its training."
    )
    how: str
    sentence: str
