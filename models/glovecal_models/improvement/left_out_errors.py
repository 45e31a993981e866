"""Each frame's error beside what was claimed for it, on takes that the fit never saw."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.effect_fit import EffectFit, correspondence_for, fit_with_effects
from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.relearned import columnless_effects
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.calibration.wanted_effect import WantedEffect
from glovecal_models.calibration.widening import Widening
from glovecal_models.effects.base.interval_effect import LeftOutErrors
from glovecal_models.errors import BadInput
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits


def left_out_errors(
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[WantedEffect],
    settings: TrainingSettings,
    *,
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
    cancelled: Callable[[], bool] | None = None,
) -> tuple[LeftOutErrors, ...]:
    """One for each rotation and take. Raises BadInput for too few takes, NotTrainable, Cancelled."""
    fewest = limits.claim_fewest_takes
    if len(takes.takes) < fewest:
        raise BadInput(
            f"how far the claimed interval is wrong shows on takes left out; {len(takes.takes)} were given, "
            f"{fewest} are needed"
        )
    found: list[LeftOutErrors] = []
    for fold in folds_over_takes(np.arange(len(takes.takes)), max(settings.folds, 2)):
        kept = takes.some(np.flatnonzero(~fold.held_out).tolist())
        left = takes.some(np.flatnonzero(fold.held_out).tolist())
        fit = fit_with_effects(kept, rotations, wanted, settings, cancelled=cancelled)
        found += _errors_of(fit, left, rotations, wanted, settings)
    return tuple(found)


def _errors_of(
    fit: EffectFit,
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[WantedEffect],
    settings: TrainingSettings,
) -> list[LeftOutErrors]:
    correction = EffectCorrection(fit.effects, list(rotations), takes.scale)
    regressors = [fit.regressor(name) for name in rotations]
    noise = np.array([regressor.noise_variance for regressor in regressors])
    inputs = [takes.inputs(correspondence_for(takes, name, settings)) for name in rotations]
    widening = Widening(columnless_effects(wanted), rotations, takes.layout.sensors, noise)
    found = []
    for number, take in enumerate(takes.takes):
        parts = [regressor.predict(each[number]) for regressor, each in zip(regressors, inputs, strict=True)]
        base = np.column_stack([part.mean for part in parts])
        readings, since = takes.readings[number], take.time_s - take.time_s[0]
        mean = base + correction.of_take(take.time_s, base, readings, take.context, take.wearing).degrees
        variance = np.column_stack([part.variance for part in parts]) + noise
        variance += widening.added_variance(since, readings)
        for column, name in enumerate(rotations):
            target = takes.target(name)[number]
            known = np.isfinite(target)
            error = mean[known, column] - target[known]
            found.append(
                LeftOutErrors(
                    take.name, name, since[known], error, target[known], variance[known, column],
                    float(noise[column]), takes.layout.sensors, readings[known],
                )
            )  # fmt: skip
    return found
