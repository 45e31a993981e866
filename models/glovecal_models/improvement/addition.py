"""What became of an effect that was added to a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glovecal_models.calibration.held_out_check import HeldOutErrors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.wanted_effect import WantedEffect
from glovecal_models.improvement.claim_check import ClaimCheck


@dataclass(frozen=True)
class Addition:
    """What became of an effect that was added."""

    effect: str
    rotations: tuple[str, ...]
    added: bool
    sentence: str
    before: HeldOutErrors
    after: HeldOutErrors
    model: CalibrationModel
    """The child; the parent itself when the effect was undone."""
    wanted: tuple[WantedEffect, ...]
    """All effects of ``model``."""
    parameters: dict[str, dict[str, float]] = field(default_factory=dict)
    """For each rotation, units in the names."""
    claim: ClaimCheck | None = None
    """Of an effect that widens the interval: how true it is before and after."""

    def to_document(self) -> dict[str, Any]:
        """Plain JSON-able data."""
        return {
            "effect": self.effect,
            "where": list(self.rotations),
            "added": self.added,
            "sentence": self.sentence,
            "before": _rmse(self.before, self.rotations),
            "after": _rmse(self.after, self.rotations),
            "parameters": self.parameters,
            "claim": None if self.claim is None else self.claim.to_document(),
        }


def total_rmse_deg(errors: HeldOutErrors, rotations: Sequence[str]) -> float:
    """Over all frames of ``rotations``."""
    square = sum(errors.square[name] for name in rotations)
    return float(np.sqrt(square / max(sum(errors.count[name] for name in rotations), 1)))


def _rmse(errors: HeldOutErrors, rotations: Sequence[str]) -> dict[str, float]:
    return {name: errors.rmse_deg(name) for name in rotations}
