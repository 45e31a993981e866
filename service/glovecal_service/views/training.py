"""How effects of a calibration model and the choice of its kernels are shown."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.regression.kernel_candidates import CANDIDATE
from glovecal_models.regression.kernel_scores import choice_of
from glovecal_models.regression.regressor import Regressor
from glovecal_service.plain import plain
from glovecal_service.views.form_curves import LaneCurvesView, curve_views


class EffectView(BaseModel):
    effect: str
    explanation: str
    rotations: list[str] = Field(description="Rotations that it corrects.")
    parameters: dict[str, dict[str, float | None]] = Field(
        description="For each rotation the learned numbers, their units in their names."
    )
    curves: dict[str, LaneCurvesView] = Field(
        description="For each rotation what a learned form adds over its inputs; empty without one."
    )
    context: list[str] = Field(description="Context columns that it needs.")
    has_memory: bool = Field(description="Whether it depends on earlier frames.")
    settling_s: float = Field(
        description="So long after a start a live pose is flagged as settling; 0: never."
    )
    evidence: dict[str, Any] = Field(description="What it saved when it was added.")
    declaration: dict[str, Any] | None = Field(description="Of an effect of the user's own.")


def effect_view(added: AddedEffect) -> dict[str, Any]:
    """Raises BadInput when this service does not have the effect."""
    effect = added.effect
    return {
        "effect": added.name,
        "explanation": effect.explanation,
        "rotations": list(added.active),
        "parameters": plain(added.described()),
        "curves": {name: item.document() for name, item in curve_views(added.curves).items()},
        "context": list(effect.context),
        "has_memory": effect.has_memory,
        "settling_s": effect.transient_s(
            added.shape[[name in added.active for name in added.rotations]], added.settings
        ),
        "evidence": plain(added.evidence),
        "declaration": plain(added.settings.get("declaration")),
    }


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
