"""A model's effects as a diagnosis takes them into its base."""

from __future__ import annotations

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.diagnosis.known_effect import KnownEffect


def known_effects(model: CalibrationModel) -> tuple[KnownEffect, ...]:
    """One for each effect; those without columns only are not looked for again."""
    return tuple(
        KnownEffect(
            item.effect,
            item.active if item.weights.shape[1] else (),
            tuple(item.shape[item.rotations.index(name)] for name in item.active)
            if item.weights.shape[1]
            else (),
        )
        for item in model.effects
    )
