"""A quick check of a new wearing: three to five held poses put a stored calibration right.

The shift of the wearing gets a Gaussian posterior (wearing_shift.py) from poses whose angles are known:
measured (``r.`` columns), or by the pose's name. The child model has the wearing's shift and what is still
uncertain of it.

The shift that a quick check found, and the error to expect with it, beside a full calibration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.samples import SensorSensitivity, require_layout, sensor_sensitivity
from glovecal_models.effects.base.wearing_effect import (
    CURVES,
    WearingCurves,
    curve_weights,
    joined_curves,
    learned_spread,
    trained_wearings,
    with_checked_wearing,
)
from glovecal_models.effects.catalogue import wearing_effect
from glovecal_models.errors import BadInput
from glovecal_models.quick_check.answer import (
    UNINFORMED,
    CheckedWearing,
    ExpectedError,
    RefusedPose,
    RotationShift,
    SensorShift,
)
from glovecal_models.quick_check.held_poses import (
    HeldPose,
    PoseBook,
    checked_poses,
    held_poses,
    pose_errors,
    usual_poses,
)
from glovecal_models.quick_check.wearing_shift import WearingShift, prior_shift, scaled_to_poses, sensor_shift
from glovecal_models.takes.take import Take

_SEEN = "wearing {!r} was in the model's training: its takes are more informative than a quick check"


@dataclass(frozen=True)
class QuickCheck:
    """What was learned from the poses of one wearing, and the model with it."""

    rotations: tuple[str, ...]
    """The L trained rotations."""
    prior: WearingShift
    shift: WearingShift
    report: CheckedWearing
    model: CalibrationModel
    """The child."""


def quick_check(
    model: CalibrationModel,
    takes: Sequence[Take],
    *,
    known: PoseBook | None = None,
    poses: Sequence[HeldPose] | None = None,
    trained_wearings: Sequence[str] = (),
    parent_id: str | None = None,
) -> QuickCheck:
    """Learn the shift of the one wearing that ``takes`` are of.

    ``known``: angles of named poses (default: flat, fist and spread of a usual hand), for rotations that a
    take did not measure. ``poses``: stretches to use instead of those found held. ``trained_wearings``: of
    the model's training takes, where that is known. Raises BadInput when the takes are of several wearings or
    of one the model was trained on, when no pose is held or known, and when the poses contradict the model or
    each other; LayoutMismatch.
    """
    known = known or usual_poses()
    wearing = _one_wearing(takes)
    if wearing in trained_wearings:
        raise BadInput(_SEEN.format(wearing))
    for take in takes:
        require_layout(take, model.layout)
    before = without_check(model, wearing)
    sensitivity = sensor_sensitivity(before)
    ranges = dict(zip(sensitivity.sensors, sensitivity.range.tolist(), strict=True))
    found, missed = ([], []) if poses is None else (list(poses), [])
    for take in takes if poses is None else ():
        held, not_held = held_poses(_named_by_itself(take, known), ranges)
        found, missed = [*found, *held], [*missed, *not_held]
    if not found:
        reasons = "; ".join(f"{item.label}: {item.reason}" for item in missed[:4])
        raise BadInput(
            "no pose was held still in these takes; hold each for about two seconds"
            + (f" ({reasons})" if reasons else "")
        )
    effect = _effect_with_columns(before, sensitivity)
    learned = _learned_sd(before, sensitivity)
    prior = prior_shift(sensitivity, learned)
    observed = pose_errors(before, effect.settings, found, sensitivity, known)
    used, witnesses, contradicted = checked_poses(observed, prior, sensitivity.rotations, known)
    if learned is None:
        prior = scaled_to_poses(prior, witnesses)
    shift = prior.after(witnesses)
    rotations = _rotation_shifts(before, sensitivity, prior, shift)
    left = [item.held_out_deg for item in used if item.held_out_deg is not None]
    noise = np.concatenate([item.variance[item.known] for item in witnesses])
    count = len(set(trained_wearings))
    is_mixed = count > 1 and not any(item.name == _effect_name() for item in model.effects)
    report = CheckedWearing(
        wearing=wearing,
        poses=used,
        refused=[*(RefusedPose(item.label, item.reason) for item in missed), *contradicted],
        rotations=rotations,
        sensors=_sensor_shifts(sensitivity, prior, shift),
        poses_before_deg=_rms([item.before_deg for item in used]),
        poses_held_out_deg=_rms(left) if left else None,
        pose_noise_deg=float(np.sqrt(noise.mean())),
        expected=ExpectedError.of(rotations),
        mixed_wearings=count if is_mixed else 0,
        separated_by=_effect_name(),
    )
    child = _child(before, effect, wearing, prior, shift, parent_id, takes)
    return QuickCheck(sensitivity.rotations, prior, shift, report, child)


def _rotation_shifts(
    model: CalibrationModel, sensitivity: SensorSensitivity, prior: WearingShift, shift: WearingShift
) -> list[RotationShift]:
    """``shift`` is what poses made of ``prior``."""
    by_name = {item.rotation: item for item in model.rotations}
    sd, prior_sd = np.sqrt(np.diag(shift.covariance)), np.sqrt(np.diag(prior.covariance))
    lanes = prior.lanes
    found = []
    for lane, name in enumerate(sensitivity.rotations):
        item = by_name[name]
        full = item.held_out_rmse_deg or float(np.sqrt(item.regressor.noise_variance))
        now, after = prior.usual_variance[lane], shift.usual_variance[lane]
        found.append(
            RotationShift(
                rotation=name,
                offset_deg=float(shift.mean[lane]),
                offset_sd_deg=float(sd[lane]),
                gain_deg_per_sd=float(shift.mean[lanes + lane]),
                gain_sd_deg_per_sd=float(sd[lanes + lane]),
                prior_sd_deg=float(prior_sd[lane]),
                expected_now_deg=float(np.sqrt(full**2 + now)),
                expected_after_deg=float(np.sqrt(full**2 + after)),
                full_calibration_deg=float(full),
                is_informed=bool(after < UNINFORMED * now),
            )
        )
    return found


def _sensor_shifts(
    sensitivity: SensorSensitivity, prior: WearingShift, shift: WearingShift
) -> list[SensorShift]:
    """Of the sensors that a rotation moves with."""
    mean, sd = sensor_shift(sensitivity, prior, shift)
    _, prior_sd = sensor_shift(sensitivity, prior, prior)
    found = []
    for column, name in enumerate(sensitivity.sensors):
        rotation = sensitivity.measuring(name)
        if rotation is None:
            continue
        slope = float(sensitivity.slope[sensitivity.rotations.index(rotation), column])
        found.append(
            SensorShift(
                sensor=name,
                readings=float(mean[column]),
                sd_readings=float(sd[column]),
                prior_sd_readings=float(prior_sd[column]),
                degrees=float(slope * mean[column]),
                sd_degrees=float(abs(slope) * sd[column]),
                is_informed=bool(sd[column] ** 2 < UNINFORMED * prior_sd[column] ** 2),
            )
        )
    return found


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def without_check(model: CalibrationModel, wearing: str) -> CalibrationModel:
    """The model as it predicts a wearing that nobody has checked; BadInput for a wearing of training."""
    effects = []
    for item in model.effects:
        if item.name == _effect_name() and wearing in trained_wearings(item.settings):
            raise BadInput(_SEEN.format(wearing))
        if item.name == _effect_name() and wearing in item.settings["wearings"]:
            at, count = item.settings["wearings"].index(wearing), len(item.settings["wearings"])
            weights = item.weights.copy()
            weights[:, [at, count + at]] = 0.0
            item = replace(item, weights=weights)
        effects.append(item)
    return replace(model, effects=tuple(effects))


def _effect_name() -> str:
    return wearing_effect().name


def _one_wearing(takes: Sequence[Take]) -> str:
    names = list(dict.fromkeys(take.wearing for take in takes))
    if not takes:
        raise BadInput("a quick check needs at least one take of the new wearing")
    if len(names) > 1:
        raise BadInput(f"the takes are of {len(names)} wearings ({', '.join(names)}); check one at a time")
    if not names[0]:
        raise BadInput(f"take {takes[0].name!r} does not say its wearing; give the wearing a name")
    return names[0]


def _named_by_itself(take: Take, known: PoseBook) -> Take:
    """A short take called after a pose, with nothing measured, is that pose."""
    if take.poses is not None or take.rotations or take.name not in known:
        return take
    return replace(take, poses=(take.name,) * len(take.time_s))


def _effect_with_columns(model: CalibrationModel, sensitivity: SensorSensitivity) -> AddedEffect:
    """The model's own effect, widened to all trained rotations; without one, an effect of no wearing yet."""
    own = [item for item in model.effects if item.name == _effect_name()]
    wearings = list(dict.fromkeys(name for item in own for name in item.settings["wearings"]))
    lanes, count = len(sensitivity.rotations), len(wearings)
    settings: dict[str, Any] = {
        "wearings": wearings,
        "own_centre_deg": sensitivity.centre_deg.tolist(),
        "own_scale_deg": sensitivity.spread_deg.tolist(),
    }
    weights, zero = np.zeros((lanes, 2 * count)), np.zeros(lanes)
    for item in own:
        names = item.settings["wearings"]
        columns = [wearings.index(name) for name in names]
        columns += [count + column for column in columns]
        for place in _active(item):
            lane = sensitivity.rotations.index(item.rotations[place])
            weights[lane, columns] = item.weights[place, : len(columns)]
            zero[lane] = item.zero_deg[place]
            for name in ("own_centre_deg", "own_scale_deg"):
                settings[name][lane] = item.settings[name][place]
        for name in ("checked", "prior_sd_deg"):
            if name in item.settings:
                settings[name] = item.settings[name]
    curves = _joined_curves(own, sensitivity)
    if curves is not None:
        settings[CURVES] = curves[0].to_document()
        weights = np.column_stack([weights, curves[1]])
    shape = np.zeros((lanes, 0))
    evidence = own[0].evidence if own else {}
    return AddedEffect(_effect_name(), sensitivity.rotations, settings, shape, weights, zero, evidence)


def _joined_curves(
    own: Sequence[AddedEffect], sensitivity: SensorSensitivity
) -> tuple[WearingCurves, np.ndarray] | None:
    """Of the wearings of training, on all trained rotations."""
    parts = []
    for item in own:
        curves = WearingCurves.of_settings(item.settings)
        if curves is not None:
            lanes = {place: sensitivity.rotations.index(item.rotations[place]) for place in _active(item)}
            parts.append((curves, lanes, curve_weights(item.settings, item.weights)))
    return joined_curves(parts, len(sensitivity.rotations))


def _active(item: AddedEffect) -> list[int]:
    """Places of the rotations that the effect has weight on."""
    return [place for place, weights in enumerate(item.weights) if weights.any()]


def _learned_sd(model: CalibrationModel, sensitivity: SensorSensitivity) -> np.ndarray | None:
    """(L, 2) degrees where the model learned how wearings differ, the default elsewhere; None: nowhere."""
    own = [item for item in model.effects if item.name == _effect_name()]
    if not own:
        return None
    default = prior_shift(sensitivity)
    sd = np.sqrt(default.lane_covariance[:, [0, 1], [0, 1]])
    for item in own:
        found = learned_spread(item.settings, item.weights)
        for place in _active(item):
            sd[sensitivity.rotations.index(item.rotations[place])] = found[place]
    return sd


def _child(
    model: CalibrationModel,
    effect: AddedEffect,
    wearing: str,
    prior: WearingShift,
    shift: WearingShift,
    parent_id: str | None,
    takes: Sequence[Take],
) -> CalibrationModel:
    pairs = shift.mean.reshape(2, -1).T
    settings, weights = with_checked_wearing(
        effect.settings, effect.weights, wearing, pairs, shift.lane_covariance
    )
    prior_sd = np.sqrt(prior.lane_covariance[:, [0, 1], [0, 1]])
    settings["prior_sd_deg"] = prior_sd.tolist()
    added = replace(effect, settings=settings, weights=weights)
    others = tuple(item for item in model.effects if item.name != _effect_name())
    simulated = model.simulated or any(take.simulated for take in takes)
    return replace(model, effects=(*others, added), parent=parent_id, simulated=simulated)
