"""Where a model fails, as an answer shows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.comparison.cross_validation_difference import CrossValidationDifference
from glovecal_models.comparison.text import cross_validation_sentences, rotation_sentence, wearings_sentence
from glovecal_models.comparison.where_it_fails import RotationFindings, WhereItFails, is_structure
from glovecal_service.plain import plain
from glovecal_service.views.ceiling import CeilingView, ceiling_view
from glovecal_service.views.noise_floor import NoiseFloorView


class SlowShareView(BaseModel):
    share: float | None = Field(description="Share of the error's variance below 1 Hz.")
    low: float | None = Field(description="95 % interval, from resampled blocks of time.")
    high: float | None


class DependenceView(BaseModel):
    covariate: str
    unit: str
    phrase: str
    edges: list[float | None]
    mean_deg: list[float | None] = Field(description="Mean error in each bin.")
    count: list[int]
    chance_deg: list[float | None] = Field(
        description="How far 95 % of the circular shifts take a bin's mean from the mean of all."
    )
    explained_deg: float | None
    p_value: float | None = Field(description="Share of circular shifts that explain as much.")
    is_structure: bool = Field(description="Significant, and large enough to matter.")


class WearingsView(BaseModel):
    rotation: str
    wearings: list[str]
    mean_deg: list[float | None]
    takes: list[int]
    spread_deg: float | None
    p_value: float | None = Field(description="Null: too few takes.")
    sentence: str


class RotationView(BaseModel):
    rotation: str
    rmse_deg: float | None
    bias_deg: float | None
    floor: NoiseFloorView | None
    other_floors: list[NoiseFloorView] = Field(description="Less good estimates of the floor.")
    slow: SlowShareView | None
    dependences: list[DependenceView]
    wearings: WearingsView | None
    sentence: str


class StretchView(BaseModel):
    take: str
    number: int = Field(description="Of the take among those given, from 0: two may have one name.")
    start_s: float
    end_s: float
    rmse_deg: float | None
    rotation: str
    rotation_rmse_deg: float | None
    pose: str


class RegionDifferenceView(BaseModel):
    rotation: str
    low_deg: float = Field(description="Range of the predicted angle.")
    high_deg: float
    difference_deg: float = Field(description="RMS difference of the two models' predictions.")
    claimed_deg: float = Field(description="Root of their summed claimed variances.")
    ratio: float
    is_significant: bool = Field(description="The model, not the noise, is wrong there.")


class CrossValidationDifferenceView(BaseModel):
    """Two models trained on disjoint halves of the model's training takes."""

    halves: list[list[str]] = Field(description="Wearings, or takes, of the two models.")
    are_wearings: bool
    regions: list[RegionDifferenceView] = Field(description="The largest ratio first.")


class FailuresView(BaseModel):
    model: str
    rotations: list[RotationView] = Field(description="The one farthest above its noise floor first.")
    stretches: list[StretchView] = Field(description="The worst seconds, worst first.")
    trained_on: list[str] = Field(description="Takes among those given that the model was trained on.")
    cross_validation_difference: CrossValidationDifferenceView | None = Field(
        None, description="Null where it was not asked for, or there are no two halves."
    )
    sentences: list[str] = Field([], description="About the cross-validation difference, if asked for.")
    ceiling: CeilingView | None = Field(
        None, description="On the takes it was asked for; null: not asked for yet."
    )


def with_cross_validation(view: FailuresView, found: CrossValidationDifference | None) -> FailuresView:
    """``view`` with what two models of disjoint halves differ by."""
    shown = None
    if found is not None:
        regions = [
            {**plain(asdict(item)), "ratio": item.ratio, "is_significant": item.is_significant}
            for item in found.regions
        ]
        shown = CrossValidationDifferenceView.model_validate(
            {"halves": found.halves, "are_wearings": found.are_wearings, "regions": regions}
        )
    sentences = cross_validation_sentences(found)
    return view.model_copy(update={"cross_validation_difference": shown, "sentences": sentences})


def failures_view(
    found: WhereItFails,
    model: str,
    trained_on: Sequence[str],
    ceiling: Mapping[str, Any] | None = None,
) -> FailuresView:
    """Of the model with the id ``model``."""
    return FailuresView.model_validate(
        {
            "model": model,
            "rotations": [_rotation(item) for item in found.rotations],
            "stretches": plain([asdict(item) for item in found.stretches]),
            "trained_on": list(trained_on),
            "ceiling": ceiling_view(ceiling),
        }
    )


def _rotation(item: RotationFindings) -> dict[str, Any]:
    facts = plain(asdict(item))
    for shown, one in zip(facts["dependences"], item.dependences, strict=True):
        shown["is_structure"] = is_structure(one, item.rmse_deg)
    if item.wearings is not None:
        facts["wearings"]["sentence"] = wearings_sentence(item.wearings)
    return {**facts, "sentence": rotation_sentence(item)}
