"""The effects that a model has already, as a diagnosis takes them for granted."""

from __future__ import annotations

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.diagnosis.known_effect import KnownEffect


def known_effects(model: CalibrationModel) -> list[KnownEffect]:
    """One for each effect that adds columns; those that repair the reference are in the takes already."""
    found = []
    for item in model.effects:
        lanes = [number for number, name in enumerate(item.rotations) if name in item.active]
        if item.weights.shape[1] and lanes:
            found.append(
                KnownEffect(
                    item.name,
                    tuple(item.rotations[lane] for lane in lanes),
                    tuple(item.settings for _ in lanes),
                    tuple(item.shape[lane] for lane in lanes),
                )
            )
    return found
