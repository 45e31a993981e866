"""What an effect with a learned form adds over each of its inputs: the numbers of a small picture."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field

from glovecal_models.effects.base.form_curve import FormCurve, LaneCurves
from glovecal_service.views.view import View


class FormCurveView(View):
    """Over one input, in bins of as many training frames each."""

    input: str = Field(description='As the effect names it; "own" for the joint\'s own angle.')
    unit: str = Field(description='Of the input: "SD" of training, "deg", or "" where it has none.')
    at: list[float | None] = Field(description="Mean of the input in each bin.")
    mean_deg: list[float | None] = Field(description="Mean of what the effect adds.")
    low_deg: list[float | None] = Field(description="10 % quantile of it.")
    high_deg: list[float | None] = Field(description="90 % quantile of it.")
    slope_deg_per_unit: float | None = Field(description="Mean slope between the input's same quantiles.")

    @classmethod
    def of(cls, curve: FormCurve) -> FormCurveView:
        return cls.model_validate(curve.to_document())


class LaneCurvesView(View):
    """Of one rotation."""

    lowest_deg: float | None = Field(description="Lowest that the effect adds in training.")
    highest_deg: float | None = Field(description="Highest that it adds.")
    inputs: list[FormCurveView]

    @classmethod
    def of(cls, curves: LaneCurves) -> LaneCurvesView:
        return cls(
            lowest_deg=curves.lowest_deg,
            highest_deg=curves.highest_deg,
            inputs=[FormCurveView.of(item) for item in curves.curves],
        )


def curve_views(curves: Mapping[str, LaneCurves]) -> dict[str, LaneCurvesView]:
    """For each rotation."""
    return {name: LaneCurvesView.of(item) for name, item in curves.items()}
