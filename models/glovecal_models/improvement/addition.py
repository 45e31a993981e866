"""What became of an effect that was added to a calibration.

The share of the error that an effect's control leaves: what the effect itself has to beat.

Adding an effect that widens the claimed interval: angles stay, standard deviations become truer.

Its constants are learned from each frame's error beside the claimed variance, on held-out takes; whether
the claim is truer with it is checked on takes that it has not learned from either.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect, EffectRequest, columnless_effects
from glovecal_models.calibration.correction_parts import IntervalInflation
from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.effect_fit import (
    Optima,
    correspondence_for,
    optima_of,
)
from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.leave_out import FitWithout, HeldOutErrors, measured_without
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings, trained_rotations
from glovecal_models.diagnosis.candidates import assessed, formed_control_share, in_any_form
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.forward_design import ForwardBasis, forward
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.diagnosis.problem import measured_joints
from glovecal_models.diagnosis.resampled import SMOOTHING, bridge_s, resampled, smoothed
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.effect import CorrectionEffect, IntervalEffect
from glovecal_models.effects.base.findings import ClaimedErrors, LiveCheck
from glovecal_models.effects.base.form_curve import LaneCurves
from glovecal_models.effects.base.signals import Settings
from glovecal_models.errors import BadInput
from glovecal_models.improvement.answer import ClaimCheck
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.progress import Cancel, stop_if
from glovecal_models.takes.take import Take

PARTS = 3
CLAIMED = ("nlpd", "coverage")
"""What a model stores of a claim, with the effect."""


@dataclass(frozen=True)
class Lineage:
    """What a child model says of where it comes from."""

    parent_id: str | None = None
    take_hashes: tuple[str, ...] = ()
    """Of its training takes; empty: those of its parent."""


@dataclass(frozen=True)
class Addition:
    """What became of an effect that was added."""

    effect: str
    rotations: tuple[str, ...]
    added: bool
    before: HeldOutErrors
    after: HeldOutErrors
    model: CalibrationModel
    """The child; the parent itself when the effect was undone."""
    wanted: tuple[EffectRequest, ...]
    """All effects of ``model``."""
    parameters: dict[str, dict[str, float]] = field(default_factory=dict)
    """For each rotation, units in the names."""
    left_out: tuple[str, ...] = ()
    """Rotations that were asked for, whose held-out error it raised."""
    judged: tuple[str, ...] = ()
    """Rotations whose held-out error decides."""
    least_gain: float = 0.0
    """Share of that error by which it must fall."""
    live: LiveCheck | None = None
    """How the effect acts on live frames, where it does."""
    claim: ClaimCheck | None = None
    """Of an effect that widens the interval: the claim decides instead of the error."""
    control_rmse_deg: float | None = None
    """Held-out error of the rotations with its control instead; None where there is none."""

    of_all_deg: tuple[float, float] | None = None
    """Held-out error of the model over all its rotations before and after; None where one is not known."""

    @property
    def judges_all(self) -> bool:
        """Whether the error that decides is that of all rotations, as a model's error is everywhere else."""
        return set(self.judged) >= set(trained_rotations(self.model))

    @property
    def curves(self) -> dict[str, LaneCurves]:
        """For each rotation what the learned form adds over its inputs; empty where it was undone."""
        mine = [item for item in self.model.effects if self.added and item.name == self.effect]
        found = {name: curves for item in mine for name, curves in item.curves.items()}
        return {name: curves for name, curves in found.items() if name in self.rotations}

    @property
    def declaration(self) -> Mapping[str, Any] | None:
        """Of an effect of the user's own; None where it was undone."""
        mine = [item for item in self.model.effects if self.added and item.name == self.effect]
        return next((item.settings.get("declaration") for item in mine), None)

    @property
    def control_share(self) -> float | None:
        """Of the held-out error of the rotations that the control leaves, at most 1."""
        before = total_rmse_deg(self.before, self.rotations)
        if self.control_rmse_deg is None or before <= 0:
            return None
        return min(self.control_rmse_deg / before, 1.0)

    @property
    def is_beaten_by_control(self) -> bool:
        """Whether the control, which cannot be right, leaves a smaller held-out error than the effect."""
        control = self.control_rmse_deg
        return control is not None and control < total_rmse_deg(self.after, self.rotations)

    @property
    def gain(self) -> float:
        """Share of the held-out error of the judged rotations that is gone."""
        before = total_rmse_deg(self.before, self.judged)
        return 1.0 - total_rmse_deg(self.after, self.judged) / max(before, 1e-12)


def total_rmse_deg(errors: HeldOutErrors, rotations: Sequence[str]) -> float:
    """Over all frames of ``rotations``."""
    square = sum(errors.square[name] for name in rotations)
    return float(np.sqrt(square / max(sum(errors.count[name] for name in rotations), 1)))


def share_left_by_control(
    model: CalibrationModel,
    takes: Sequence[Take],
    effect: CorrectionEffect,
    rotations: Sequence[str],
    *,
    known_share: float | None = None,
    has_form: bool = False,
    cancelled: Cancel | None = None,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> float | None:
    """Of the RMSE of ``rotations`` on held-out takes, at most 1; None when the takes cannot judge it.

    ``known_share``: what a diagnosis found for the effect's own columns; ``has_form``: the effect has learned
    a form, so that its control may learn one too, and counts with it where that leaves less.
    Raises Cancelled.
    """

    def progress(text: str, share: float) -> None:
        stop_if(cancelled, "adding an effect")

    joints = [name for name in measured_joints(takes, model.layout) if name in rotations]
    if not joints:
        return None
    bridge = bridge_s(takes)
    even = [smoothed(resampled(take, model.layout.sensors, joints, bridge), SMOOTHING) for take in takes]
    on = ModelOnTakes.of_repaired(model, takes).without(effect.name)
    basis = ForwardBasis.of(
        even,
        model.layout,
        joints,
        linear=on.linear,
        same_angle_share=limits.same_angle_share,
        same_angle_deg=limits.same_angle_deg,
    )
    direction = forward(basis, joints, known=on.known, limits=limits)
    if known_share is None:
        generator = np.random.default_rng(0)
        found, _ = assessed(direction, [effect], generator, set(), progress)
        judged = [in_any_form(direction, effect, item, generator) for item in found]
        known_share = control_share(judged[0], rotations) if judged else None
    formed = formed_control_share(direction, effect, joints) if has_form else None
    return min((share for share in (known_share, formed) if share is not None), default=None)


def share_in(diagnosis: Diagnosis | None, name: str, rotations: Sequence[str]) -> float | None:
    """The same from a diagnosis; None without one, or when it does not rank the effect."""
    ranked = diagnosis.naming.ranked if diagnosis is not None else ()
    judged = next((item for item in ranked if item.effect == name), None)
    return None if judged is None else control_share(judged, rotations)


def control_share(judged: Assessment, rotations: Sequence[str]) -> float | None:
    """The same from an assessment; None when it has none of ``rotations``."""
    pairs = zip(judged.joints, judged.errors, strict=True)
    errors = [error for name, error in pairs if name in rotations]
    base = sum(float(error.base.sum()) for error in errors)
    control = sum(float(error.control.sum()) for error in errors)
    return min(float(np.sqrt(max(control, 0.0) / base)), 1.0) if base > 0 else None


def add_interval(
    model: CalibrationModel,
    effect: IntervalEffect,
    fresh: EffectRequest,
    has: Sequence[EffectRequest],
    takes: PreparedTakes,
    settings: TrainingSettings,
    *,
    lineage: Lineage,
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
    cancelled: Cancel | None = None,
) -> Addition:
    """``model`` with ``fresh``, if the held-out NLPD falls with it; its regressors stay as they are.

    An effect that takes of usual length may hide stays when the NLPD does not rise.
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
    numbers = {name: value for name, value in asdict(claim).items() if name.startswith(CLAIMED)}
    is_no_worse = numbers["nlpd_after"] - numbers["nlpd_before"] <= limits.claim_most_rise_nats
    hidden = effect.hidden
    shows_later = hidden is not None and is_no_worse and hidden.widens(learned, fresh.rotations)
    if not claim.is_truer and not shows_later:
        return Addition(fresh.name, fresh.rotations, False, errors, errors, model, tuple(has), claim=claim)
    rotations = tuple(dict.fromkeys((*(earlier.rotations if earlier else ()), *fresh.rotations)))
    nothing = np.zeros((len(rotations), 0))
    added = AddedEffect(fresh.name, rotations, learned, nothing, nothing, np.zeros(len(rotations)), numbers)
    kept = tuple(item for item in model.effects if item.name != fresh.name)
    child = replace(
        model, effects=(*kept, added), parent=lineage.parent_id, takes=lineage.take_hashes or model.takes
    )
    wanted = (*others, EffectRequest(fresh.effect, rotations, learned))
    return Addition(
        fresh.name, fresh.rotations, True, errors, errors, child, wanted, added.described(), claim=claim
    )


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
    first, then = (_claim(errors, np.concatenate(each)) for each in (before, after))
    least = limits.claim_least_fall_nats
    return ClaimCheck(*first, *then, is_truer=first[0] - then[0] >= least, least_fall_nats=least)


def _added(effect: IntervalEffect, settings: Settings, item: ClaimedErrors) -> np.ndarray:
    interval = effect.interval(settings, [item.rotation], item.sensors, np.array([item.noise]))
    return interval.added_variance(item.since_start_s, item.readings)[:, 0]


def _claim(error: np.ndarray, variance: np.ndarray) -> tuple[float, float, float]:
    """NLPD in nats, and the shares within 1 and 1.96 standard deviations."""
    scaled = error**2 / variance
    return (
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
    folds = folds_over_takes(np.arange(len(takes.takes)), max(settings.folds, 2))
    found = measured_without(
        partial(_errors_of, wanted), takes, [fold.held_out for fold in folds], rotations, wanted, settings,
        optima=optima, is_optional=False, cancelled=cancelled,
    )  # fmt: skip
    return tuple(item for _, of_fold in found for item in of_fold)


def _errors_of(wanted: Sequence[EffectRequest], of: FitWithout) -> list[ClaimedErrors]:
    fit, takes, rotations, settings = of.fit, of.left, of.rotations, of.settings
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
