"""A noise floor as an answer shows it."""

from __future__ import annotations

from dataclasses import asdict

from pydantic import BaseModel, Field

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_service.plain import plain


class NoiseFloorView(BaseModel):
    floor_deg: float | None = Field(description="How small an error can get on these measurements.")
    low_deg: float | None = Field(description="95 % interval, from resampled pieces.")
    high_deg: float | None
    prediction_deg: float | None = Field(description="The part that is the prediction's own jitter.")
    how: str = Field(
        description="still hand, still joint, repeated poses, spectrum, frame to frame or near readings; the "
        "best first. stated: what the reference states of itself is larger than any of these."
    )
    pieces: int = Field(description="Holds, repeats or blocks of time that it was pooled from.")
    is_lower_bound: bool = Field(description="Autocorrelated noise is not included.")
    is_reliable: bool = Field(True, description="Whether nothing speaks against it.")
    reasons: list[str] = Field([], description="Why it is not reliable, each as the end of a sentence.")
    estimate_deg: float | None = Field(
        None, description="The estimate itself, where it lies above the error; a floor is never above it."
    )

    reference_deg: float | None = Field(
        None, description="RMS of the standard deviations that a camera states; null: none are stated."
    )

    @classmethod
    def of(cls, floor: NoiseFloor) -> NoiseFloorView:
        return cls.model_validate(plain(asdict(floor)))
