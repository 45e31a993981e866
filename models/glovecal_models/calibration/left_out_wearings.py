"""Wearings left out whole: how a calibration with its effects predicts one that it has not seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.calibration.effect_fit import (
    EffectFit,
    Optima,
    correspondence_for,
    fit_with_effects,
)
from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.folds import wearing_groups
from glovecal_models.calibration.held_out_check import errors_of
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings, left_out_settings
from glovecal_models.calibration.unseen_wearing import LeftOutWearing
from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel


def left_out_wearings(
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    *,
    optima: Optima = (),
    cancelled: Cancel | None = None,
) -> list[LeftOutWearing]:
    """Empty with a single wearing. ``optima`` as in ``held_out_errors``. Raises Cancelled."""
    wearings = [take.wearing for take in takes.takes]
    settings, found = left_out_settings(settings), []
    for group in wearing_groups(wearings):
        kept = takes.some([at for at, name in enumerate(wearings) if name not in group])
        try:
            fit = fit_with_effects(kept, rotations, wanted, settings, optima=optima, cancelled=cancelled)
        except NotTrainable:
            continue  # what is left cannot carry a model: it says nothing about the error
        trained = len(set(wearings) - set(group))
        for wearing in group:
            left = takes.some([at for at, name in enumerate(wearings) if name == wearing])
            found += _left_out(fit, left, rotations, settings, wearing, trained)
    return found


def _left_out(
    fit: EffectFit,
    takes: PreparedTakes,
    rotations: Sequence[str],
    settings: TrainingSettings,
    wearing: str,
    trained: int,
) -> list[LeftOutWearing]:
    errors, found = errors_of(fit, takes, rotations, settings), []
    for name in rotations:
        regressor, each = fit.regressor(name), takes.inputs(correspondence_for(takes, name, settings))
        variance = np.concatenate(
            [
                regressor.predict(part[np.isfinite(target)]).variance
                for part, target in zip(each, takes.target(name), strict=True)
                if np.isfinite(target).any()
            ]
            or [np.empty(0)]
        )
        if len(variance):
            noise = float(regressor.noise_variance)
            square, claimed = float(errors[name] @ errors[name]), float(variance.mean()) + noise
            found.append(LeftOutWearing(name, wearing, trained, square, len(errors[name]), claimed, noise))
    return found
