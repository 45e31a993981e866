"""How to train: the choices a caller may make, with defaults that work.

How to train a model again: its effects, rotations, settings and repaired takes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from glovecal_models.calibration.added_effect import EffectRequest
from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.people_prior import PeoplePlane
from glovecal_models.calibration.samples import DEFAULT_SAMPLES
from glovecal_models.effects.base.effect import (
    Effect,
    RepairEffect,
)
from glovecal_models.effects.catalogue import effect
from glovecal_models.errors import BadInput
from glovecal_models.regression.fast_lmc import LmcOptimum
from glovecal_models.regression.kernel_candidates import CHOOSING
from glovecal_models.regression.kernel_scores import kernel_of
from glovecal_models.regression.regressor import RuleRegressor
from glovecal_models.takes.take import Take


class PriorPlane(NamedTuple):
    """What a linear calibration says of one rotation, by the names of its sensors."""

    rotation: str
    sensors: tuple[str, ...]
    gains: tuple[float, ...]
    """Degrees a count."""
    offset_deg: float
    """At readings of 0."""


@dataclass(frozen=True)
class TrainingSettings:
    """How to train. The defaults suit a CyberGlove; all of them enter each task's key."""

    method: Method = "lmc_gpr"
    samples: int = DEFAULT_SAMPLES
    """Largest representative set for one rotation."""
    folds: int = 3
    """Held-out folds for the error estimate; 0 trains without one."""
    pseudo_inputs: int = 100
    iterations: int = 200
    seed: int = 0
    keep_dead: bool = False
    """Whether sensors that are dead or clipped in the takes are kept, so that one that never changes is
    refused; else they are left out (``usable_sensors``)."""
    kernels: tuple[tuple[str, str], ...] = ()
    """(rotation, candidate kernel) already chosen: when a model is trained again, with an effect for example,
    its kernels stay, so that a change of the error is the effect's."""

    optima: tuple[tuple[str, LmcOptimum], ...] = ()
    """(rotation, optimum) already found with more takes: a fold of the same training keeps its sample weight
    and begins its search there."""

    prior: tuple[PriorPlane, ...] = ()
    """Planes that are the mean of LMC-GPR (``prior_mean``); no other method has one."""

    people: tuple[PeoplePlane, ...] = ()
    """What other people's takes say of the planes of method ``linear``; no other method has them."""

    people_wearing: str = ""
    """The wearing that such planes are for; empty: the takes' only one, else one more."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "kernels", tuple((str(name), str(kernel)) for name, kernel in self.kernels))
        if self.folds < 0 or self.folds == 1:
            raise BadInput(
                f"folds is {self.folds}: one fold would hold out everything; 0 trains without an error "
                "estimate, 2 or more with one"
            )
        if self.prior and self.method != "lmc_gpr":
            raise BadInput(f"a prior mean is for method lmc_gpr, not for {self.method}")
        if self.people and self.method != "linear":
            raise BadInput(f"a prior of people is for method linear, not for {self.method}: --method linear")
        stored = (PeoplePlane.from_document(item) if isinstance(item, dict) else item for item in self.people)
        object.__setattr__(self, "people", tuple(stored))


LEFT_OUT_SAMPLES = 500
"""For one rotation: what wearings differ by is far above what more samples would save."""


def left_out_settings(settings: TrainingSettings) -> TrainingSettings:
    """How the fits without a wearing are trained."""
    return replace(settings, samples=min(settings.samples, LEFT_OUT_SAMPLES))


def requested_effects(model: CalibrationModel) -> tuple[EffectRequest, ...]:
    """The effects a model has, as they would be asked for again."""
    merged: dict[str, EffectRequest] = {}
    for item in model.effects:
        if item.of_wearings is not None and not item.of_wearings.are_trained:
            continue  # training takes tell nothing of a wearing that only a quick check saw
        before = merged.get(item.name)
        rotations = item.active if before is None else (*before.rotations, *item.active)
        settings = item.settings
        if item.weights.shape[1]:
            settings = item.correction.further.with_found({}, item.settings)
        merged[item.name] = EffectRequest(item.effect, tuple(dict.fromkeys(rotations)), settings)
    return tuple(merged.values())


def trained_rotations(model: CalibrationModel) -> tuple[str, ...]:
    """Rotations with a regressor of their own, no rule."""
    return tuple(item.rotation for item in model.rotations if not isinstance(item.regressor, RuleRegressor))


def repaired_takes(takes: Sequence[Take], wanted: Sequence[EffectRequest]) -> list[Take]:
    """The takes with what their measurement needs: clocks on the frames' time, faulty pieces left out."""
    result = list(takes)
    for item in wanted:
        if isinstance(item.effect, RepairEffect):
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
