"""The effects of a model that its user declared as expressions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.effects.base.effect import Effect


def declared_in(model: CalibrationModel) -> list[Effect]:
    """The declared effects that a model holds."""
    found = {item.name: item.effect for item in model.effects if "declaration" in item.settings}
    return list(found.values())


def declaration_of(model: CalibrationModel, name: str) -> Mapping[str, Any] | None:
    """The document that declares a model's effect, None for one of the catalogue."""
    for item in model.effects:
        if item.name == name and "declaration" in item.settings:
            return item.settings["declaration"]
    return None
