"""What a diagnosis found: evidence, names or silence with a reason, and what to record next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from glovecal_models.diagnosis.diagnosis_document import document
from glovecal_models.diagnosis.hold_drift import HoldDrift
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.diagnosis.next_take import NextTake
from glovecal_models.diagnosis.not_identifiable import NotJudgeable
from glovecal_models.diagnosis.signatures import may_explain
from glovecal_models.diagnosis.something_left import Left
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.signature_effect import Finding


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """Ranked evidence for effects that a model does not know yet."""

    joints: tuple[str, ...]
    rmse_deg: dict[str, float]
    """Held-out error of each joint without any further effect, on smoothed signals."""
    noise_floor_deg: dict[str, float]
    naming: Naming
    assessments: tuple[Assessment, ...]
    """Every effect that could be judged."""
    not_judgeable: tuple[NotJudgeable, ...]
    reference_problems: tuple[str, ...]
    findings: tuple[Finding, ...]
    """What is known by a signature in the recording."""
    left: Left
    next_take: NextTake | None
    effects: Mapping[str, Effect]
    """Those asked for, by name."""
    hold_drift: HoldDrift | None = None
    """Where the reference only names poses: what the readings do while one is held."""
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    @property
    def signature(self) -> tuple[Finding, ...]:
        """Findings of the effect that is to be named by its signature, before any ranking; mostly none."""
        repairs = {item.effect for item in self.findings if self.effects[item.effect].kind == "repair"}
        for name in dict.fromkeys(item.effect for item in self.findings if item.effect in repairs):
            if name not in self.naming.confidence_set:
                return tuple(item for item in self.findings if item.effect == name)
        if self.naming.ranked:
            last = [item for item in self.findings if self.effects[item.effect].stage == "last"]
            return tuple(item for item in last if may_explain(self.effects[item.effect], self.naming))
        return tuple(item for item in self.findings if item.effect == self.findings[0].effect)

    @property
    def by_gain(self) -> list[Assessment]:
        """All assessments, those that pass first, then by how much they save."""
        return sorted(
            self.assessments,
            key=lambda item: (not item.touched, -item.saved_square, -max(e.contrast for e in item.errors)),
        )

    def to_document(self) -> dict[str, Any]:
        """Plain JSON-able data with sentences."""
        return document(self)
