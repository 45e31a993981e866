"""The calibration model of a fit with effects, and which effects stay when rotations are trained again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.effect_fit import EffectFit, correspondence_for
from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.held_out_check import HeldOutErrors
from glovecal_models.calibration.left_out_wearings import left_out_wearings
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training import noise_of, uncertain_above
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.calibration.unseen_wearing import unseen_wearing
from glovecal_models.progress import Cancel
from glovecal_models.regression.kernel_scores import keeping_choice
from glovecal_models.regression.regressor import RuleRegressor


def child_model(
    parent: CalibrationModel,
    parent_id: str | None,
    takes: PreparedTakes,
    fit: EffectFit,
    effects: Sequence[AddedEffect],
    errors: HeldOutErrors,
    settings: TrainingSettings,
    take_hashes: Sequence[str],
    wanted: Sequence[EffectRequest] = (),
    cancelled: Cancel | None = None,
) -> CalibrationModel:
    """``parent`` with the regressors of ``fit`` in place of its own, and with ``effects``.

    ``wanted``: with which the error in a wearing not seen is measured anew. Raises Cancelled.
    """
    fresh = {name: _rotation_model(takes, name, fit, errors, settings) for name in fit.results}
    rotations = tuple(_renewed(item, fresh.get(item.rotation)) for item in parent.rotations)
    left_out = left_out_wearings(
        takes, tuple(fresh), wanted, settings, optima=fit.optima, cancelled=cancelled
    )
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
        parent=parent_id,
        takes=tuple(take_hashes) or parent.takes,
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


def columnless_effects(
    wanted: Sequence[EffectRequest], before: Sequence[AddedEffect] = ()
) -> list[AddedEffect]:
    """The effects among ``wanted`` that have settings only: repairs of the measurement, wider intervals.

    Those there were ``before`` keep their evidence.
    """
    evidence = {item.name: item.evidence for item in before}
    found = []
    for item in wanted:
        if not item.has_columns:
            nothing = np.zeros((len(item.rotations), 0))
            zero = np.zeros(len(item.rotations))
            known = evidence.get(item.name, {})
            found.append(AddedEffect(item.name, item.rotations, item.settings, nothing, nothing, zero, known))
    return found
