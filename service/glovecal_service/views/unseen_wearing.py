"""The error of a model in a wearing that it has not seen, as answers show it."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.text import wearing_sentences
from glovecal_service.plain import plain


class UnseenWearingView(BaseModel):
    rmse_unseen_wearing_deg: float | None = Field(
        description="Each wearing left out whole; null: one wearing only, or not estimated."
    )
    interval_deg: list[float] | None = Field(description="95 % interval of the error in one more wearing.")
    rmse_deg: float | None = Field(description="On held-out takes of the wearings seen.")
    wearings: list[str] = Field(description="Of the training takes.")
    per_rotation: dict[str, float] = Field(description="RMSE by rotation, each wearing left out whole.")
    per_wearing: dict[str, float] = Field(description="RMSE in each wearing, left out whole.")
    between_sd_deg: dict[str, float] = Field(description="Standard deviation between wearings, by rotation.")
    freedom: float = Field(description="Degrees of freedom of the t distribution of the next wearing.")
    sentences: list[str]


def unseen_wearing_view(model: CalibrationModel, seen_deg: float | None = None) -> dict[str, Any] | None:
    """``seen_deg``: error in wearings seen (default: the model's own estimate). None: an older model."""
    found = model.unseen_wearing
    if found is None:
        return None
    seen_deg = model.error_estimate.get("rmse_deg") if seen_deg is None else seen_deg
    return plain(
        {
            "rmse_unseen_wearing_deg": found.rmse_deg,
            "interval_deg": found.interval_deg,
            "rmse_deg": seen_deg,
            "wearings": found.wearings,
            "per_rotation": found.per_rotation,
            "per_wearing": found.per_wearing,
            "between_sd_deg": found.between_sd_deg,
            "freedom": found.freedom,
            "sentences": wearing_sentences(model, seen_deg),
        }
    )
