"""Errors of a calibration model on takes with reference, and whether its standard deviations are right.

Two calibrations from disjoint halves of the recordings, compared posture by posture.

Where two models that saw different wearings (or, with one wearing, different takes) differ by no more than
the root of their summed claimed variances, noise explains the difference. Where they differ by much more the
model is wrong there: its form, or something that it is not told. (mrcal compares camera calibrations so,
from disjoint sets of images: https://mrcal.secretsauce.net/tour-cross-validation.html.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.effect_fit import EffectFit, correspondence_for, fit_with_effects
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import (
    TrainingSettings,
    left_out_settings,
    repaired_takes,
    requested_effects,
    settings_of,
    trained_rotations,
)
from glovecal_models.comparison.answer import Comparison, PoseErrors, RotationErrors
from glovecal_models.comparison.delay_curve import LiveAndDelayed, live_and_delayed
from glovecal_models.comparison.fingertips import fingertip_errors
from glovecal_models.comparison.floor_estimate import NoiseFloor, joined
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.noise_floor import RotationNoise, rotation_noise
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.comparison.where.answer import CrossValidationDifference, RegionDifference
from glovecal_models.errors import NotTrainable
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.progress import Cancel
from glovecal_models.takes.camera_estimates import covered_ranges
from glovecal_models.takes.take import Take

ROWS_AT_MOST = 4000
REGIONS = 6
FEWEST_TAKES_OF_A_HALF = 2
"""In a half; one take alone rarely covers the postures of the others."""
FEWEST_ROWS_OF_A_REGION = 30
"""In a region; fewer say nothing."""


def compare(
    model: CalibrationModel,
    takes: Sequence[Take],
    *,
    offline: bool = False,
    dimensions: HandDimensions | None = None,
) -> Comparison:
    """Errors of ``model`` on ``takes``. Raises LayoutMismatch, and BadInput when nothing was measured.

    ``offline``: of angles estimated with both directions of time, beside live and delayed ones;
    ``dimensions`` of the subject's hand, for the errors of fingertips.
    """
    predicted = residuals(model, takes, offline=offline)
    causal = live_and_delayed(model, takes, predicted) if offline else None
    return summed_up(predicted, causal=causal, dimensions=dimensions)


def summed_up(
    found: Residuals,
    noise: Mapping[str, RotationNoise] | None = None,
    *,
    causal: LiveAndDelayed | None = None,
    dimensions: HandDimensions | None = None,
) -> Comparison:
    """Residuals as numbers: over all, each rotation, each pose, fingertips. ``noise`` spares its time;
    ``causal``: live and delayed angles where ``found`` are offline."""
    noise = rotation_noise(found) if noise is None else noise
    error, spread, reference = (found.stacked(name) for name in ("error", "sd", "measured"))
    measured = found.measured_rotations
    columns = {name: [found.column(name)] for name in measured}
    in_takes = {name for item in found.takes for name in item.take.rotations}
    rotations = {
        name: _errors(error[:, column], spread[:, column], reference[:, column], noise[name].floor)
        for name, column in columns.items()
    }
    return Comparison(
        overall=_errors(error, spread, reference, _floor_of_all(rotations)),
        rotations=rotations,
        poses=_pose_errors(error, np.concatenate([_poses(item.take) for item in found.takes])),
        not_measured=tuple(name for name in found.rotations if name not in measured),
        not_predicted=tuple(sorted(in_takes - set(found.rotations))),
        fingertips=fingertip_errors(found, {name: one.floor for name, one in rotations.items()}, dimensions),
        unseen_wearing=_errors_where(found, is_seen=False),
        seen_wearing=_errors_where(found, is_seen=True),
        unseen_wearings=_wearings_where(found, is_seen=False),
        seen_wearings=_wearings_where(found, is_seen=True),
        excluded=found.excluded,
        camera_ranges=covered_ranges([item.take for item in found.takes], measured),
        live=None if causal is None else _of_all(causal.live),
        delayed=() if causal is None else causal.delayed,
    )


def _wearings_where(found: Residuals, *, is_seen: bool) -> tuple[str, ...]:
    chosen = [
        item for item in found.takes if item.has_seen_wearing is is_seen and np.isfinite(item.error).any()
    ]
    return tuple(dict.fromkeys(item.take.wearing for item in chosen))


def _errors_where(found: Residuals, *, is_seen: bool) -> RotationErrors | None:
    """Overall, of the takes whose wearing the model knows, or does not know."""
    chosen = tuple(item for item in found.takes if item.has_seen_wearing is is_seen)
    if not any(np.isfinite(item.error).any() for item in chosen):
        return None
    return _of_all(Residuals(found.rotations, chosen))


def _of_all(found: Residuals) -> RotationErrors:
    """Overall, without a floor."""
    return _errors(found.stacked("error"), found.stacked("sd"), found.stacked("measured"), None)


def _poses(take: Take) -> np.ndarray:
    return np.array(take.poses if take.poses is not None else [""] * len(take.time_s), dtype=object)


def _floor_of_all(rotations: Mapping[str, RotationErrors]) -> NoiseFloor | None:
    """None when that of some rotation is unknown."""
    known = [(one.floor, one.count) for one in rotations.values() if one.floor is not None]
    return joined(*zip(*known, strict=True)) if known and len(known) == len(rotations) else None


def _errors(
    error: np.ndarray, spread: np.ndarray, reference: np.ndarray, floor: NoiseFloor | None
) -> RotationErrors:
    usable = np.isfinite(error)
    values, claimed = error[usable], spread[usable]
    counts = np.maximum(usable.sum(axis=0), 1)
    centred = reference - np.where(usable, reference, 0.0).sum(axis=0) / counts
    rmse = float(np.sqrt(np.mean(values**2)))
    return RotationErrors(
        count=len(values),
        rmse_deg=rmse,
        mae_deg=float(np.mean(np.abs(values))),
        bias_deg=float(np.mean(values)),
        percentile_95_deg=float(np.percentile(np.abs(values), 95)),
        coverage=float(np.mean(np.abs(values) <= claimed)),
        nlpd=_nlpd(values, claimed),
        baseline_deg=float(np.sqrt(np.mean(centred[usable] ** 2))),
        floor=None if floor is None else floor.beside(rmse),
    )


def _nlpd(values: np.ndarray, claimed: np.ndarray) -> float | None:
    if not (np.isfinite(claimed) & (claimed > 0)).all():
        return None
    return float(np.mean(np.log(claimed * np.sqrt(2 * np.pi)) + 0.5 * (values / claimed) ** 2))


def _pose_errors(error: np.ndarray, poses: np.ndarray) -> tuple[PoseErrors, ...]:
    names = [name for name in dict.fromkeys(poses.tolist()) if name]
    found = []
    for name in names:
        values = np.abs(error[poses == name])
        values = values[np.isfinite(values)]
        if len(values):
            found.append(PoseErrors(name, len(values), float(values.mean()), float(values.std())))
    return tuple(found)


def cross_validation_difference(
    model: CalibrationModel,
    takes: Sequence[Take],
    settings: TrainingSettings | None = None,
    *,
    limits: ComparisonLimits = COMPARISON_LIMITS,
    cancelled: Cancel | None = None,
) -> CrossValidationDifference | None:
    """``model`` trained again on each half of its training ``takes``; None for fewer than two takes in a
    half, or where a half cannot carry a model. Raises Cancelled."""
    wanted = requested_effects(model)
    prepared = PreparedTakes.of(repaired_takes(takes, wanted), model.layout)
    wearings = [take.wearing for take in takes]
    are_wearings = len(set(wearings)) > 1
    owners = wearings if are_wearings else [f"{take.name} ({at + 1})" for at, take in enumerate(takes)]
    names = list(dict.fromkeys(owners))
    halves = (tuple(names[0::2]), tuple(names[1::2]))
    if any(sum(owner in half for owner in owners) < FEWEST_TAKES_OF_A_HALF for half in halves):
        return None
    settings, rotations = left_out_settings(settings_of(model, settings)), trained_rotations(model)
    try:
        fits = [
            fit_with_effects(
                prepared.some([at for at, name in enumerate(owners) if name in half]),
                rotations, wanted, settings, cancelled=cancelled,
            )
            for half in halves
        ]  # fmt: skip
    except NotTrainable:
        return None
    first, second = (_predicted(fit, prepared, rotations, settings) for fit in fits)
    known = model.unseen_wearing
    between = known.between_sd_deg if known is not None and are_wearings else {}
    regions = _regions(rotations, first, second, between, limits)
    return CrossValidationDifference(halves, are_wearings, tuple(regions))


def _predicted(
    fit: EffectFit, takes: PreparedTakes, rotations: Sequence[str], settings: TrainingSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and claimed variance (N, R) at frames of all takes, evenly spread; degrees, degrees squared.

    Every take is predicted as of a wearing that nobody named: a half must not know the other's wearings.
    """
    regressors = [fit.regressor(name) for name in rotations]
    noise = np.array([regressor.noise_variance for regressor in regressors])
    inputs = [takes.inputs(correspondence_for(takes, name, settings)) for name in rotations]
    correction = EffectCorrection(fit.effects, list(rotations), takes.scale)
    step = max(1, sum(len(take.time_s) for take in takes.takes) // ROWS_AT_MOST)
    means, variances = [], []
    for number, take in enumerate(takes.takes):
        parts = [regressor.predict(each[number]) for regressor, each in zip(regressors, inputs, strict=True)]
        base = np.column_stack([part.mean for part in parts])
        added = correction.of_take(take.time_s, base, takes.readings[number], take.context, "").degrees
        means.append((base + added)[::step])
        variances.append((np.column_stack([part.variance for part in parts]) + noise)[::step])
    return np.concatenate(means), np.concatenate(variances)


def _regions(
    rotations: Sequence[str],
    first: tuple[np.ndarray, np.ndarray],
    second: tuple[np.ndarray, np.ndarray],
    between: Mapping[str, float],
    limits: ComparisonLimits,
) -> list[RegionDifference]:
    """Of each rotation in equal ranges of its predicted angle, the largest ratio first."""
    found = []
    for column, name in enumerate(rotations):
        a, b = first[0][:, column], second[0][:, column]
        claimed = first[1][:, column] + second[1][:, column] + 2 * between.get(name, 0.0) ** 2
        angle = (a + b) / 2
        low_end, high_end = np.percentile(angle, [1, 99]).tolist()
        edges = np.linspace(low_end, high_end, REGIONS + 1)
        for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            rows = (angle >= low) & (angle <= high)
            if rows.sum() >= FEWEST_ROWS_OF_A_REGION:
                difference = float(np.sqrt(np.mean((a[rows] - b[rows]) ** 2)))
                sd = float(np.sqrt(np.mean(claimed[rows])))
                ratio = difference / sd
                is_wrong = ratio > limits.cross_validation_ratio
                found.append(RegionDifference(name, low, high, difference, sd, ratio, is_wrong))
    return sorted(found, key=lambda item: -item.ratio)
