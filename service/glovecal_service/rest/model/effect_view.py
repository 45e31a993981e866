"""How an effect of a calibration model is shown: where it is, what was learned, and what spoke for it."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_service.plain import plain


class EffectView(BaseModel):
    effect: str
    explanation: str
    rotations: list[str] = Field(description="Rotations that it corrects.")
    parameters: dict[str, dict[str, float | None]] = Field(
        description="For each rotation the learned numbers, their units in their names."
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
        "context": list(effect.context),
        "has_memory": effect.has_memory,
        "settling_s": effect.settling_s(added.shape[[name in added.active for name in added.rotations]]),
        "evidence": plain(dict(added.evidence)),
        "declaration": plain(added.settings.get("declaration")),
    }
