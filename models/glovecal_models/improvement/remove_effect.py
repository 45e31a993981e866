"""Removing an effect from a calibration: its rotations are learned anew without it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.calibration.child_model import child_model, columnless_effects
from glovecal_models.calibration.effect_fit import fit_with_effects
from glovecal_models.calibration.held_out_check import HeldOutErrors, held_out_errors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.model_recipe import (
    repaired_takes,
    requested_effects,
    settings_of,
    trained_rotations,
)
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.improvement.addition import Addition
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.names import did_you_mean
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take


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
    errors = held_out_errors(prepared, every, wanted, settings, optima=fit.optima, cancelled=cancelled)
    effects = [*fit.effects, *columnless_effects(wanted, model.effects)]
    return child_model(
        model, parent_id, prepared, fit, effects, errors, settings, take_hashes, wanted, cancelled
    )


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
