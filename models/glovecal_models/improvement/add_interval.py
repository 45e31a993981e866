"""Adding an effect that widens the claimed interval: angles stay, standard deviations become truer.

Its constants are learned from each frame's error beside the claimed variance, on held-out takes; whether
the claim is truer with it is checked on takes that it has not learned from either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.child_model import columnless_effects
from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.effect_fit import (
    EffectFit,
    Optima,
    correspondence_for,
    fit_with_effects,
    optima_of,
)
from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.held_out_check import HeldOutErrors
from glovecal_models.calibration.interval_inflation import IntervalInflation
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.interval_effect import ClaimedErrors, IntervalEffect
from glovecal_models.errors import BadInput
from glovecal_models.improvement.addition import Addition, Claim, ClaimCheck
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.progress import Cancel

PARTS = 3


def add_interval(
    model: CalibrationModel,
    effect: IntervalEffect,
    fresh: EffectRequest,
    has: Sequence[EffectRequest],
    takes: PreparedTakes,
    settings: TrainingSettings,
    *,
    parent_id: str | None = None,
    take_hashes: Sequence[str] = (),
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
    cancelled: Cancel | None = None,
) -> Addition:
    """``model`` with ``fresh``, if the held-out NLPD falls with it; its regressors stay as they are.

    An effect that ``shows_later`` than takes last stays when the NLPD does not rise.
    ``has``: the model's effects. Raises BadInput for fewer than three takes, NotTrainable, Cancelled.
    """
    others = [item for item in has if item.name != fresh.name]
    earlier = next((item for item in has if item.name == fresh.name), None)
    found = dict(earlier.settings if earlier else {}) | fresh.settings
    held_out = claimed_errors(
        takes, fresh.rotations, others, settings, optima=optima_of(model), limits=limits, cancelled=cancelled
    )
    errors = _sums(held_out)
    claim = check_claim(effect, held_out, found, limits)
    learned = effect.learned(held_out, found)
    shows_later = effect.shows_later and claim.is_no_worse and effect.widens(learned, fresh.rotations)
    if not claim.is_truer and not shows_later:
        return Addition(fresh.name, fresh.rotations, False, errors, errors, model, tuple(has), claim=claim)
    rotations = tuple(dict.fromkeys((*(earlier.rotations if earlier else ()), *fresh.rotations)))
    nothing = np.zeros((len(rotations), 0))
    added = AddedEffect(
        fresh.name, rotations, learned, nothing, nothing, np.zeros(len(rotations)), claim_evidence(claim)
    )
    kept = tuple(item for item in model.effects if item.name != fresh.name)
    child = replace(model, effects=(*kept, added), parent=parent_id, takes=tuple(take_hashes) or model.takes)
    wanted = (*others, EffectRequest(fresh.effect, rotations, learned))
    return Addition(
        fresh.name, fresh.rotations, True, errors, errors, child, wanted, added.described(), claim=claim
    )


def claim_evidence(claim: ClaimCheck) -> dict[str, float]:
    """As a model stores it with the effect, and as JSON."""
    return {
        f"{name}_{when}": value
        for when, one in (("before", claim.before), ("after", claim.after))
        for name, value in asdict(one).items()
    }


def _sums(held_out: Sequence[ClaimedErrors]) -> HeldOutErrors:
    square: dict[str, float] = {}
    count: dict[str, int] = {}
    for item in held_out:
        square[item.rotation] = square.get(item.rotation, 0.0) + float(item.error @ item.error)
        count[item.rotation] = count.get(item.rotation, 0) + len(item.error)
    return HeldOutErrors(square, count)


def check_claim(
    effect: IntervalEffect,
    held_out: Sequence[ClaimedErrors],
    found: Settings,
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
) -> ClaimCheck:
    """Learn from two thirds of the takes, judge on the rest, in turns."""
    names = list(dict.fromkeys(item.take for item in held_out))
    error, before, after = [], [], []
    for part in range(PARTS):
        held = set(names[part::PARTS])
        judged = [item for item in held_out if item.take in held]
        settings = effect.learned([item for item in held_out if item.take not in held], found)
        for item in judged:
            error.append(item.error)
            before.append(item.variance)
            after.append(item.variance + _added(effect, settings, item))
    errors = np.concatenate(error)
    claims = [_claim(errors, np.concatenate(each)) for each in (before, after)]
    return ClaimCheck(claims[0], claims[1], limits)


def _added(effect: IntervalEffect, settings: Settings, item: ClaimedErrors) -> np.ndarray:
    interval = effect.interval(settings, [item.rotation], item.sensors, np.array([item.noise]))
    return interval.added_variance(item.since_start_s, item.readings)[:, 0]


def _claim(error: np.ndarray, variance: np.ndarray) -> Claim:
    scaled = error**2 / variance
    return Claim(
        float(np.mean(0.5 * np.log(2 * np.pi * variance) + 0.5 * scaled)),
        float(np.mean(scaled <= 1.0)),
        float(np.mean(scaled <= 1.959964**2)),
    )


def claimed_errors(
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
    *,
    optima: Optima = (),
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
    cancelled: Cancel | None = None,
) -> tuple[ClaimedErrors, ...]:
    """One for each rotation and take. Raises BadInput for too few takes, NotTrainable, Cancelled."""
    fewest = limits.claim_fewest_takes
    if len(takes.takes) < fewest:
        raise BadInput(
            f"the claimed interval is checked on held-out takes; {len(takes.takes)} were given,"
            f" {fewest} are needed"
        )
    found: list[ClaimedErrors] = []
    for fold in folds_over_takes(np.arange(len(takes.takes)), max(settings.folds, 2)):
        kept = takes.some(np.flatnonzero(~fold.held_out).tolist())
        left = takes.some(np.flatnonzero(fold.held_out).tolist())
        fit = fit_with_effects(kept, rotations, wanted, settings, optima=optima, cancelled=cancelled)
        found += _errors_of(fit, left, rotations, wanted, settings)
    return tuple(found)


def _errors_of(
    fit: EffectFit,
    takes: PreparedTakes,
    rotations: Sequence[str],
    wanted: Sequence[EffectRequest],
    settings: TrainingSettings,
) -> list[ClaimedErrors]:
    correction = EffectCorrection(fit.effects, list(rotations), takes.scale)
    regressors = [fit.regressor(name) for name in rotations]
    noise = np.array([regressor.noise_variance for regressor in regressors])
    inputs = [takes.inputs(correspondence_for(takes, name, settings)) for name in rotations]
    inflation = IntervalInflation(columnless_effects(wanted), rotations, takes.layout.sensors, noise)
    found = []
    for number, take in enumerate(takes.takes):
        parts = [regressor.predict(each[number]) for regressor, each in zip(regressors, inputs, strict=True)]
        base = np.column_stack([part.mean for part in parts])
        readings, since = takes.readings[number], take.time_s - take.time_s[0]
        mean = base + correction.of_take(take.time_s, base, readings, take.context, take.wearing).degrees
        variance = np.column_stack([part.variance for part in parts]) + noise
        variance += inflation.added_variance(since, readings)
        for column, name in enumerate(rotations):
            target = takes.target(name)[number]
            known = np.isfinite(target)
            error = mean[known, column] - target[known]
            found.append(
                ClaimedErrors(
                    take.name, name, since[known], error, target[known], variance[known, column],
                    float(noise[column]), takes.layout.sensors, readings[known],
                )
            )  # fmt: skip
    return found
