"""Removing an effect from a calibration: its rotations are learned anew without it.

The calibration model of a fit with effects, and which effects stay when rotations are trained again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect, EffectRequest, columnless_effects
from glovecal_models.calibration.effect_fit import EffectFit, correspondence_for, fit_with_effects
from glovecal_models.calibration.learned_lead import with_leads
from glovecal_models.calibration.leave_out import HeldOutErrors, held_out_errors, left_out_wearings
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training import noise_of, uncertain_above
from glovecal_models.calibration.training_settings import (
    TrainingSettings,
    repaired_takes,
    requested_effects,
    settings_of,
    trained_rotations,
)
from glovecal_models.calibration.unseen_wearing import unseen_wearing
from glovecal_models.errors import BadInput
from glovecal_models.improvement.addition import Addition, Lineage
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.names import did_you_mean
from glovecal_models.progress import Cancel
from glovecal_models.regression.kernel_scores import keeping_choice
from glovecal_models.regression.regressor import RuleRegressor
from glovecal_models.takes.take import Take


def child_model(
    parent: CalibrationModel,
    lineage: Lineage,
    takes: PreparedTakes,
    fit: EffectFit,
    effects: Sequence[AddedEffect],
    errors: HeldOutErrors,
    settings: TrainingSettings,
    wanted: Sequence[EffectRequest] = (),
    cancelled: Cancel | None = None,
) -> CalibrationModel:
    """``parent`` with the regressors of ``fit`` in place of its own, and with ``effects``.

    ``wanted``: with which the error in a wearing not seen is measured anew. Raises Cancelled.
    """
    fresh = {name: _rotation_model(takes, name, fit, errors, settings) for name in fit.results}
    rotations = tuple(_renewed(item, fresh.get(item.rotation)) for item in parent.rotations)
    left_out = [
        *left_out_wearings(takes, tuple(fresh), wanted, settings, optima=fit.optima, cancelled=cancelled)
    ]
    if parent.unseen_wearing is not None:
        left_out += [item for item in parent.unseen_wearing.left_out if item.rotation not in fresh]
    wearings = [take.wearing for take in takes.takes]
    unseen = unseen_wearing(wearings, left_out, noise_of(rotations))
    estimate: dict[str, Any] = {
        "how": "whole takes left out" if len(takes.takes) > 1 else "stretches of the only take left out",
        "folds": max(settings.folds, 2),
    }
    of_all = _of_all(takes, rotations, errors)
    if of_all is not None:
        estimate["rmse_deg"] = of_all.overall_deg
    if unseen.rmse_deg is not None:
        estimate["rmse_unseen_wearing_deg"] = unseen.rmse_deg
    return replace(
        parent,
        rotations=rotations,
        parent=lineage.parent_id,
        takes=lineage.take_hashes or parent.takes,
        error_estimate=estimate,
        effects=tuple(effects),
        sensor_centre=takes.scale.centre,
        sensor_scale=takes.scale.scale,
        simulated=parent.simulated or any(take.simulated for take in takes.takes),
        unseen_wearing=unseen,
    )


def _of_all(
    takes: PreparedTakes, rotations: Sequence[RotationModel], errors: HeldOutErrors
) -> HeldOutErrors | None:
    """``errors``, and what is known of rotations that were not learned anew; None where one is not known.

    A model's error is of all its rotations, whichever of them an effect was added to.
    """
    square, count = {}, {}
    for item in rotations:
        if item.rotation in errors.square or isinstance(item.regressor, RuleRegressor):
            continue
        if item.held_out_rmse_deg is None:
            return None
        count[item.rotation] = sum(int(np.isfinite(part).sum()) for part in takes.target(item.rotation))
        square[item.rotation] = count[item.rotation] * item.held_out_rmse_deg**2
    return HeldOutErrors(square, count).with_those_of(errors)


def _renewed(before: RotationModel, fresh: RotationModel | None) -> RotationModel:
    """``fresh`` where there is one; how its kernel was chosen stays told."""
    if fresh is None:
        return before
    return replace(fresh, regressor=keeping_choice(before.regressor, fresh.regressor))


def _rotation_model(
    takes: PreparedTakes, name: str, fit: EffectFit, errors: HeldOutErrors, settings: TrainingSettings
) -> RotationModel:
    correspondence = correspondence_for(takes, name, settings)
    regressor = fit.regressor(name)
    known = [np.isfinite(target) for target in takes.target(name)]
    inputs = np.concatenate(
        [part[rows] for part, rows in zip(takes.inputs(correspondence), known, strict=True)]
    )
    return RotationModel(
        correspondence=correspondence,
        regressor=regressor,
        input_low=inputs.min(axis=0),
        input_high=inputs.max(axis=0),
        uncertain_above_deg=uncertain_above(regressor.noise_variance),
        held_out_rmse_deg=errors.rmse_deg(name) if name in errors.square else None,
        samples=min(len(inputs), settings.samples),
    )


def kept_lanes(effects: Sequence[AddedEffect], relearned: Sequence[str]) -> list[AddedEffect]:
    """``effects`` without weight on the rotations learned anew; those left without any are dropped."""
    kept = []
    for item in effects:
        stays = np.array([name not in relearned for name in item.rotations])
        weights = np.where(stays[:, None], item.weights, 0.0)
        if weights.any():
            known = item.covariance
            covariance = None if known is None else np.where(stays[:, None, None], known, 0.0)
            kept.append(replace(item, weights=weights, covariance=covariance))
    return kept


def errors_if_redundant(
    model: CalibrationModel,
    takes: Sequence[Take],
    name: str,
    now: HeldOutErrors,
    settings: TrainingSettings | None = None,
    cancelled: Cancel | None = None,
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
) -> HeldOutErrors | None:
    """The errors without effect ``name`` where it is redundant on the rotations of ``now``, else None."""
    settings = settings_of(model, settings)
    wanted = [item for item in requested_effects(model) if item.name != name]
    prepared = PreparedTakes.of(repaired_takes(takes, wanted), model.layout)
    most_deg = limits.needless_times * now.overall_deg
    # However many frames the folds measure, they are not more than there are.
    frames = sum(
        int(np.isfinite(part).sum()) for rotation in now.square for part in prepared.target(rotation)
    )
    most_square = frames * most_deg**2
    without = held_out_errors(
        prepared, tuple(now.square), wanted, settings, most_square=most_square, cancelled=cancelled
    )
    is_redundant = sum(without.square.values()) <= most_square and without.overall_deg <= most_deg
    return without if is_redundant else None


def remove_effect(
    model: CalibrationModel,
    takes: Sequence[Take],
    name: str,
    *,
    settings: TrainingSettings | None = None,
    parent_id: str | None = None,
    take_hashes: Sequence[str] = (),
    cancelled: Cancel | None = None,
) -> CalibrationModel:
    """The model without effect ``name``. Raises BadInput when it has none of that name, Cancelled."""
    has = requested_effects(model)
    if name not in {item.name for item in has}:
        meant = did_you_mean(name, (item.name for item in has), there="it has")
        raise BadInput(f"the model has no effect {name!r}; {meant}")
    settings = settings_of(model, settings)
    wanted = [item for item in has if item.name != name]
    every = trained_rotations(model)
    prepared = PreparedTakes.of(repaired_takes(takes, wanted), model.layout)
    fit = fit_with_effects(prepared, every, wanted, settings, cancelled=cancelled)
    fit = with_leads(fit, prepared, settings)
    errors = held_out_errors(prepared, every, wanted, settings, optima=fit.optima, cancelled=cancelled)
    effects = [*fit.effects, *columnless_effects(wanted, model.effects)]
    lineage = Lineage(parent_id, tuple(take_hashes))
    return child_model(model, lineage, prepared, fit, effects, errors, settings, wanted, cancelled)


def without_redundant(
    addition: Addition,
    takes: Sequence[Take],
    errors: HeldOutErrors,
    settings: TrainingSettings,
    take_hashes: Sequence[str],
    cancelled: Cancel | None,
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
) -> tuple[CalibrationModel, HeldOutErrors, tuple[str, ...]]:
    """The child without earlier effects that the new one makes redundant (an alias may have come first), the
    ``errors`` then, and the names of the removed. Raises Cancelled."""
    model, removed = addition.model, []
    for earlier in addition.wanted:
        # An effect that widens the interval explains no error, and makes no other redundant.
        if earlier.name == addition.effect or not earlier.has_columns or addition.claim is not None:
            continue
        now = errors.of(earlier.rotations)
        without = errors_if_redundant(model, takes, earlier.name, now, settings, cancelled, limits)
        if without is not None:
            errors = errors.with_those_of(without)
            removed.append(earlier.name)
            model = remove_effect(
                model, takes, earlier.name, settings=settings, take_hashes=take_hashes, cancelled=cancelled
            )
    return model, errors, tuple(removed)
