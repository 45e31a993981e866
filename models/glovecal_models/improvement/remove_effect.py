"""Taking an effect out of a calibration again: its rotations are learned anew without it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import repaired_takes, settings_of, trained_rotations, wanted_of
from glovecal_models.improvement.child_model import child_model
from glovecal_models.improvement.effect_fit import fit_with_effects
from glovecal_models.improvement.held_out_check import held_out_errors
from glovecal_models.improvement.prepared_takes import PreparedTakes
from glovecal_models.improvement.relearned import columnless_effects
from glovecal_models.takes.take import Take


def remove_effect(
    model: CalibrationModel,
    takes: Sequence[Take],
    name: str,
    *,
    settings: TrainingSettings | None = None,
    parent_id: str | None = None,
    take_hashes: Sequence[str] = (),
    cancelled: Callable[[], bool] | None = None,
) -> CalibrationModel:
    """The model without effect ``name``. Raises BadInput when it has none of that name, Cancelled."""
    has = wanted_of(model)
    if name not in {item.name for item in has}:
        there = ", ".join(item.name for item in has) or "none"
        raise BadInput(f"the model has no effect {name!r}; it has {there}")
    settings = settings_of(model, settings)
    wanted = [item for item in has if item.name != name]
    every = trained_rotations(model)
    prepared = PreparedTakes.of(repaired_takes(takes, wanted), model.layout)
    fit = fit_with_effects(prepared, every, wanted, settings, cancelled=cancelled)
    errors = held_out_errors(prepared, every, wanted, settings, cancelled=cancelled)
    effects = [*fit.effects, *columnless_effects(wanted)]
    return child_model(model, parent_id, prepared, fit, effects, errors, settings, take_hashes)
