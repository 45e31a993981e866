"""How to train a model again: its effects, rotations, settings and repaired takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.catalogue import effect
from glovecal_models.regression.kernel_candidates import CHOOSING
from glovecal_models.regression.kernel_scores import kernel_of
from glovecal_models.regression.regressor import RuleRegressor
from glovecal_models.takes.take import Take


def requested_effects(model: CalibrationModel) -> tuple[EffectRequest, ...]:
    """The effects a model has, as they would be asked for again."""
    merged: dict[str, EffectRequest] = {}
    for item in model.effects:
        if not item.effect.is_of_training(item.settings):
            continue  # training takes tell nothing of a wearing that only a quick check saw
        before = merged.get(item.name)
        rotations = item.active if before is None else (*before.rotations, *item.active)
        settings = item.settings
        if item.weights.shape[1]:
            settings = item.effect.settings_with_found({}, item.settings)
        merged[item.name] = EffectRequest(item.effect, tuple(dict.fromkeys(rotations)), settings)
    return tuple(merged.values())


def trained_rotations(model: CalibrationModel) -> tuple[str, ...]:
    """Rotations with a regressor of their own, no rule."""
    return tuple(item.rotation for item in model.rotations if not isinstance(item.regressor, RuleRegressor))


def repaired_takes(takes: Sequence[Take], wanted: Sequence[EffectRequest]) -> list[Take]:
    """The takes with what their measurement needs: clocks on the frames' time, faulty pieces left out."""
    result = list(takes)
    for item in wanted:
        if item.is_on_reference and isinstance(item.effect, SignatureEffect):
            result = list(item.effect.repaired(result, item.settings))
    return result


def settings_of(model: CalibrationModel, settings: TrainingSettings | None) -> TrainingSettings:
    """How the model was trained, as far as it tells; kernels that were chosen for it stay."""
    settings = settings or TrainingSettings(method=model.method)  # pyright: ignore[reportArgumentType]
    if settings.method not in CHOOSING:
        return settings
    kernels = {item.rotation: kernel_of(item.regressor) for item in model.rotations}
    return replace(settings, kernels=tuple((name, kind) for name, kind in kernels.items() if kind))


def declared_effects(model: CalibrationModel) -> list[Effect]:
    """The declared effects that a model holds."""
    found = {item.name: item.effect for item in model.effects if "declaration" in item.settings}
    return list(found.values())


def effect_named(model: CalibrationModel, name: str) -> Effect:
    """The model's own declared effect of that name, else the catalogue's. Raises BadInput."""
    own = {item.name: item for item in declared_effects(model)}
    return own[name] if name in own else effect(name)


def declaration_of(model: CalibrationModel, name: str) -> Mapping[str, Any] | None:
    """The document that declares a model's effect, None for one of the catalogue."""
    for item in model.effects:
        if item.name == name and "declaration" in item.settings:
            return item.settings["declaration"]
    return None
