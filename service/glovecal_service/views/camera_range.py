"""Which angles of a rotation a camera accepted, as an answer shows it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.takes.camera_reference.covered_range import CoveredRange
from glovecal_service.plain import plain


class CameraRangeView(BaseModel):
    rotation: str
    ranges_deg: list[tuple[float, float]] = Field(
        description="From low to high; angles outside are not judged. Empty: too little was accepted."
    )
    effective_samples: int = Field(description="Accepted samples; those within 0.3 s count as one.")
    sd_deg: float | None = Field(description="RMS of the stated standard deviations.")
    sentence: str


def camera_range_views(ranges: Sequence[CoveredRange]) -> list[dict[str, Any]]:
    return [
        {
            "rotation": item.rotation,
            "ranges_deg": plain(item.ranges_deg),
            "effective_samples": item.effective_samples,
            "sd_deg": plain(item.deviation_deg),
            "sentence": item.sentence(),
        }
        for item in ranges
    ]
