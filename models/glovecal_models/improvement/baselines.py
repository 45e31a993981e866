"""Errors of simpler calibrations on the same takes, for scale."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.calibration.held_out_check import held_out_errors
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import Method, TrainingSettings
from glovecal_models.comparison.residuals import residuals
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

SIMPLER: tuple[Method, ...] = ("raw", "linear")


def baselines(
    takes: Sequence[Take],
    layout: Layout,
    rotations: Sequence[str],
    settings: TrainingSettings,
    holdout: Sequence[Take],
) -> dict[str, float]:
    """RMSE in degrees by method, on ``holdout`` or, without one, on takes left out."""
    found: dict[str, float] = {}
    for method in SIMPLER:
        if method == settings.method:
            continue
        if holdout:
            model = train(takes, layout, "baseline", TrainingSettings(method=method, folds=0))
            error = residuals(model, holdout).stacked("error")
            found[method] = float(np.sqrt(np.nanmean(error**2)))
        else:
            plain = TrainingSettings(method=method, folds=settings.folds)
            prepared = PreparedTakes.of(takes, layout)
            found[method] = held_out_errors(prepared, rotations, [], plain).over_all_deg
    return found
