"""Errors of fingertips as an answer shows them."""

from __future__ import annotations

from pydantic import BaseModel, Field


class TipFloor(BaseModel):
    floor_mm: float | None = Field(description="The joints' noise floors, carried to the tip.")
    low_mm: float | None = Field(description="From the ends of the joints' 95 % intervals.")
    high_mm: float | None
    is_lower_bound: bool = Field(description="That of some joint is one.")


class TipErrorsView(BaseModel):
    count: int = Field(description="Frames; over all: frames times fingers.")
    rmse_mm: float | None
    percentile_95_mm: float | None
    baseline_mm: float | None = Field(description="Error of always answering the mean angles.")
    floor: TipFloor | None = Field(description="How small the RMSE can get; null: unknown for some joint.")
    taken_equal: list[str] = Field(
        description="Rotations of the chain that were not predicted and measured in all of these frames: "
        "there they are the same in both hands."
    )


class WorstTipView(BaseModel):
    finger: str
    error_mm: float | None
    take: str
    time_s: float = Field(description="Since the start of the take.")
    measured_deg: dict[str, float] = Field(description="Every rotation of the hand in this frame.")
    predicted_deg: dict[str, float]


class FingertipsView(BaseModel):
    """Distances between predicted and measured fingertips, seen from the palm."""

    hand_length_mm: float
    is_assumed: bool = Field(description="Nobody measured this subject's hand.")
    over_all: TipErrorsView
    fingers: dict[str, TipErrorsView] = Field(
        description="thumb to pinky, those whose chain was predicted and measured."
    )
    thumb_index: TipErrorsView | None = Field(
        description="Of the distance between the tips of thumb and index finger."
    )
    worst: WorstTipView
    sentence: str
