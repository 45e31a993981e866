"""A comparison with measurements as an answer shows it: errors in degrees, of fingertips in mm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.comparison.compare import Comparison
from glovecal_models.comparison.fingertips import FingertipErrors
from glovecal_models.comparison.text import (
    camera_sentences,
    fingertips_sentence,
    wearing_error_sentences,
)
from glovecal_service.plain import plain
from glovecal_service.views.camera_range import CameraRangeView, camera_range_views
from glovecal_service.views.ceiling import CeilingView, ceiling_view
from glovecal_service.views.noise_floor import NoiseFloorView


class ErrorsView(BaseModel):
    count: int
    rmse_deg: float | None
    mae_deg: float | None
    bias_deg: float | None
    percentile_95_deg: float | None
    coverage: float | None = Field(
        description="Share of errors within one claimed standard deviation; expected: 0.68."
    )
    nlpd: float | None = Field(
        description="Mean negative log predictive density, nats; a correct constant standard deviation has "
        "ln(RMSE) + 1.42. Null where a claimed standard deviation is 0."
    )
    baseline_deg: float | None = Field(description="Error when predicting the mean of the measurements.")
    floor: NoiseFloorView | None = Field(
        description="How small the RMSE can get; null: too little was measured."
    )


class PoseErrorsView(BaseModel):
    pose: str
    count: int
    mean_deg: float | None
    sd_deg: float | None


class TipFloorView(BaseModel):
    floor_mm: float | None = Field(description="The joints' noise floors, carried to the tip.")
    low_mm: float | None = Field(description="From the ends of the joints' 95 % intervals.")
    high_mm: float | None
    is_lower_bound: bool = Field(description="That of some joint is one.")
    is_reliable: bool = Field(True, description="That of every joint is.")


class TipErrorsView(BaseModel):
    count: int = Field(description="Frames; overall: frames times fingers.")
    rmse_mm: float | None
    percentile_95_mm: float | None
    baseline_mm: float | None = Field(description="Error when predicting the mean angles.")
    floor: TipFloorView | None = Field(
        description="How small the RMSE can get; null: unknown for some joint."
    )
    assumed_equal: list[str] = Field(
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
    is_assumed: bool = Field(description="This subject's hand was not measured.")
    overall: TipErrorsView
    fingers: dict[str, TipErrorsView] = Field(
        description="thumb to pinky, those whose chain was predicted and measured."
    )
    thumb_index: TipErrorsView | None = Field(
        description="Of the distance between the tips of thumb and index finger."
    )
    worst: WorstTipView
    sentence: str


class ComparisonView(BaseModel):
    model: str
    overall: ErrorsView
    rotations: dict[str, ErrorsView]
    rmse_unseen_wearing_deg: float | None = Field(
        description="Of the takes whose wearing the model has not seen; null: there are none, or unknown."
    )
    unseen_wearing: ErrorsView | None = Field(description="Overall, in wearings that the model has not seen.")
    seen_wearing: ErrorsView | None = Field(description="Overall, in wearings that it knows.")
    unseen_wearings: list[str]
    seen_wearings: list[str]
    sentences: list[str] = Field(
        description="Errors in wearings not seen and seen; what a camera accounts for."
    )
    poses: list[PoseErrorsView]
    not_measured: list[str]
    not_predicted: list[str]
    fingertips: FingertipsView | None = Field(
        description="Null where no finger's chain was predicted and measured."
    )
    excluded: dict[str, int] = Field(
        description="Measured frames, by rotation, that are not compared: faulty sensors, repeated frames."
    )
    camera_ranges: list[CameraRangeView] = Field(
        [],
        description="Of rotations that a camera measured: angles outside of these ranges were not compared.",
    )
    trained_on: list[str] = Field(description="Takes among those given that the model was trained on.")
    ceiling: CeilingView | None = Field(
        None, description="On the takes it was asked for; null: not asked for yet."
    )


def comparison_view(
    found: Comparison,
    model: str,
    trained_on: Sequence[str],
    ceiling: Mapping[str, Any] | None = None,
) -> ComparisonView:
    """Of the model with the id ``model``."""
    facts = plain(asdict(found))
    unseen = found.unseen_wearing
    facts |= {
        "rmse_unseen_wearing_deg": None if unseen is None else plain(unseen.rmse_deg),
        "sentences": [*wearing_error_sentences(found), *camera_sentences(found)],
        "camera_ranges": camera_range_views(found.camera_ranges),
    }
    facts |= {"fingertips": _fingertips(found.fingertips), "model": model, "trained_on": list(trained_on)}
    facts["ceiling"] = ceiling_view(ceiling)
    return ComparisonView.model_validate(facts)


def _fingertips(found: FingertipErrors | None) -> dict[str, Any] | None:
    return None if found is None else {**plain(asdict(found)), "sentence": fingertips_sentence(found)}
