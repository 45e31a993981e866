"""The drift of a session, as REST and ``--json`` give it."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.takes.session_drift import SessionDrift
from glovecal_models.takes.text import drift_sentence


class SessionDriftView(BaseModel):
    shapes: list[str]
    rms_deg: float | None = Field(description="Over shapes and rotations; null without a model.")
    mean_deg: dict[str, float] = Field(description="By rotation, the mean over shapes, end less start.")
    mean_counts: dict[str, float] = Field(description="By sensor.")
    left_out: dict[str, str] = Field(description="Shapes that were not held, or not in both, and why.")
    sentence: str


def session_drift_view(found: SessionDrift) -> dict[str, Any]:
    return {
        "shapes": list(found.shapes),
        "rms_deg": found.rms_deg,
        "mean_deg": dict(zip(found.rotations, found.common_deg.tolist(), strict=True))
        if found.rotations
        else {},
        "mean_counts": dict(zip(found.sensors, found.common_counts.tolist(), strict=True)),
        "left_out": dict(found.left_out),
        "sentence": drift_sentence(found),
    }
