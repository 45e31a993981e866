"""How a rotation's kernel was chosen, as JSON."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.regression.kept_choice import choice_of
from glovecal_models.regression.kernel_candidates import CANDIDATE
from glovecal_models.regression.regressor import Regressor
from glovecal_service.plain import plain


class KernelScoreView(BaseModel):
    kernel: str
    words: str
    chosen: bool
    nlml: float = Field(description="Negative log marginal likelihood, nats, of densities per degree.")
    evidence_gain: float = Field(description="Nats over the first candidate, after a price per parameter.")
    held_out_rmse_deg: float | None = Field(description="On takes left out of the trial, degrees.")


class KernelChoiceView(BaseModel):
    sentence: str
    samples: int = Field(description="On which all candidates were tried.")
    straight_line_deg: float | None = Field(description="Held-out error of a straight line, degrees.")
    spread_deg: float | None = Field(description="Error of always saying the mean angle, degrees.")
    candidates: list[KernelScoreView]


def kernel_view(rotation: str, regressor: Regressor) -> dict[str, Any] | None:
    """None when nothing was chosen."""
    found = choice_of(regressor)
    if found is None:
        return None
    return {
        "sentence": found.sentence(rotation),
        "samples": found.samples,
        "straight_line_deg": plain(found.straight_line_deg),
        "spread_deg": plain(found.spread_deg),
        "candidates": [
            {
                "kernel": item.name,
                "words": CANDIDATE[item.name].words,
                "chosen": item is found.chosen,
                "nlml": plain(item.nlml),
                "evidence_gain": plain(found.evidence_gain(item)),
                "held_out_rmse_deg": plain(item.held_out_rmse_deg),
            }
            for item in found.scores
        ],
    }
