"""A quick check of a new wearing: three to five held poses put a stored calibration right.

The shift of the wearing gets a Gaussian posterior (wearing_shift.py) from poses whose angles are known:
measured (``r.`` columns), or by the pose's name. The child model has the wearing's shift and what is still
uncertain of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.samples import require_layout
from glovecal_models.calibration.sensor_sensitivity import SensorSensitivity, sensor_sensitivity
from glovecal_models.effects.base.wearing_curves import CURVES, WearingCurves, joined_curves
from glovecal_models.effects.base.wearing_effect import (
    curve_weights,
    learned_spread,
    trained_wearings,
    with_checked_wearing,
)
from glovecal_models.effects.catalogue import wearing_effect
from glovecal_models.errors import BadInput
from glovecal_models.quick_check.checked_poses import CheckedPose, RefusedPose, checked_poses
from glovecal_models.quick_check.held_poses import HeldPose, held_poses
from glovecal_models.quick_check.pose_book import PoseBook, usual_poses
from glovecal_models.quick_check.pose_errors import pose_errors
from glovecal_models.quick_check.shift_report import ShiftReport, shift_report
from glovecal_models.quick_check.wearing_shift import WearingShift, prior_shift, scaled_to_poses
from glovecal_models.takes.take import Take

_SEEN = "wearing {!r} was in the model's training: its takes are more informative than a quick check"


@dataclass(frozen=True)
class QuickCheck:
    """What was learned from the poses of one wearing, and the model with it."""

    wearing: str
    rotations: tuple[str, ...]
    """The L trained rotations."""
    prior: WearingShift
    shift: WearingShift
    poses: tuple[CheckedPose, ...]
    refused: tuple[RefusedPose, ...]
    report: ShiftReport
    mixed_wearings: int
    """On how many wearings the model was trained without an effect that separates them; 0: it has one."""
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
    used, contradicted = checked_poses(observed, prior, sensitivity.rotations, known)
    if learned is None:
        prior = scaled_to_poses(prior, [item.witness for item in used])
    shift = prior.after(item.witness for item in used)
    refused = (*(RefusedPose(item.label, item.reason) for item in missed), *contradicted)
    report = shift_report(before, sensitivity, prior, shift, used)
    count = len(set(trained_wearings))
    mixed = count if count > 1 and not any(item.name == _effect_name() for item in model.effects) else 0
    child = _child(before, effect, wearing, prior, shift, parent_id, takes)
    return QuickCheck(wearing, sensitivity.rotations, prior, shift, used, refused, report, mixed, child)


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
