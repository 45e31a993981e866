"""The errors of a model's recipe on whole takes that its fit never saw, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.calibration.effect_fit import Optima, fit_with_effects
from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.held_out_check import frame_errors_of
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.progress import Cancel, Report

FOLDS = 4


def held_out_take_errors(
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    *,
    optima: Optima = (),
    cancelled: Cancel | None = None,
    report: Report | None = None,
) -> list[np.ndarray]:
    """For each take (N, R), predicted minus measured, degrees; NaN where nothing was measured.

    ``optima`` as in ``fit_with_effects``. Raises NotTrainable, Cancelled.
    """
    found = [np.empty((0, 0))] * len(takes.takes)
    folds = folds_over_takes(np.arange(len(takes.takes)), FOLDS)
    for number, fold in enumerate(folds):
        if report:
            report(f"leaving out {fold.sentence}", number / len(folds))
        held = np.flatnonzero(fold.held_out).tolist()
        kept = takes.some(np.flatnonzero(~fold.held_out).tolist())
        fit = fit_with_effects(kept, rotations, wanted, settings, optima=optima, cancelled=cancelled)
        for at, errors in zip(held, frame_errors_of(fit, takes.some(held), rotations, settings), strict=True):
            found[at] = errors
    return found
