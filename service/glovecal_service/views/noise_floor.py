"""A noise floor as an answer shows it."""

from __future__ import annotations

from pydantic import BaseModel, Field


class NoiseFloorView(BaseModel):
    floor_deg: float | None = Field(description="How small an error can get on these measurements.")
    low_deg: float | None = Field(description="95 % interval, from resampled pieces.")
    high_deg: float | None
    prediction_deg: float | None = Field(description="The part that is the prediction's own jitter.")
    how: str = Field(
        description="still hand, still joint, repeated poses, spectrum, frame to frame or near readings; the "
        "best first."
    )
    pieces: int = Field(description="Holds, repeats or blocks of time that it was pooled from.")
    is_lower_bound: bool = Field(description="Autocorrelated noise is not included.")
