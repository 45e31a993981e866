"""How far the smoothed motion of a late reading is led, learned from the takes of a fit.

The measured angle is explained by the smoothed motion's angle, velocity and acceleration, in least squares:
of one low pass the velocity's weight is its time, of a delay the acceleration has half its square. The
smoothing is the one with which the lead is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.correction_parts import CorrectionParts
from glovecal_models.calibration.effect_correction import EffectCorrection, usable_correction
from glovecal_models.calibration.effect_fit import EffectFit, correspondence_for
from glovecal_models.calibration.motion_smoother import SmoothedMotion, smoothed
from glovecal_models.calibration.offline import (
    LEAD,
    UNLED,
    Lead,
    is_late,
    late_angles,
    leads_of,
    led_angles,
    parts_led,
)
from glovecal_models.calibration.predictor import LEAST_VARIANCE
from glovecal_models.calibration.prepared_takes import OwnSignal, PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings

LEAST_MEASURED = 100
"""Measured frames from which a lead is learned."""


def with_leads(fit: EffectFit, takes: PreparedTakes, settings: TrainingSettings) -> EffectFit:
    """A fit to ``takes`` whose late effects have learned how to lead smoothed readings."""
    late = dict.fromkeys(name for item in fit.effects if is_late(item) for name in item.active)
    if not late:
        return fit
    motions = _motions(fit, takes, settings, dict.fromkeys(late, UNLED))
    found = {name: _learned(motions, list(fit.results).index(name), takes, name) for name in late}
    documents = {name: asdict(lead) for name, lead in found.items() if lead is not None}

    def led(item: AddedEffect) -> AddedEffect:
        own = {name: documents[name] for name in item.active if name in documents}
        return replace(item, settings=item.settings | {LEAD: own}) if is_late(item) else item

    return replace(fit, effects=tuple(map(led, fit.effects)))


def offline_errors_of(
    fit: EffectFit, takes: PreparedTakes, rotations: Sequence[str], settings: TrainingSettings
) -> list[np.ndarray]:
    """For each take (N, R), estimated with both directions of time minus measured, degrees; NaN where nothing
    was measured. The fit is one ``with_leads``."""
    leads = leads_of(fit.effects)
    each = [leads.get(name, UNLED) for name in fit.results]
    chosen = [list(fit.results).index(name) for name in rotations]
    targets = zip(*(takes.target(name) for name in rotations), strict=True)
    return [
        led_angles(motion, each)[0][:, chosen] - np.column_stack(target)
        for motion, target in zip(_motions(fit, takes, settings, leads), targets, strict=True)
    ]


def _motions(
    fit: EffectFit, takes: PreparedTakes, settings: TrainingSettings, leads: Mapping[str, Lead]
) -> list[SmoothedMotion]:
    """Of each take, all rotations of the fit; late where there are ``leads``."""
    names = list(fit.results)
    own = [
        OwnSignal.of(takes, correspondence_for(takes, name, settings), fit.regressor(name)) for name in names
    ]
    effects, led = EffectCorrection(fit.effects, names, takes.scale), parts_led(fit.effects, leads, names)
    motions = []
    for number, take in enumerate(takes.takes):
        base = np.column_stack([signal.takes[number] for signal in own])
        parts = CorrectionParts(*base.shape)
        readings = takes.readings[number]
        added = effects.of_take(take.time_s, base, readings, take.context, take.wearing, parts).degrees
        late = late_angles(base + np.where(usable_correction(added), added, 0.0), added, parts.found, led)
        motions.append(smoothed(take.time_s, late.degrees, late.known))
    return motions


def _learned(motions: Sequence[SmoothedMotion], row: int, takes: PreparedTakes, rotation: str) -> Lead | None:
    """By least squares of what was measured; None where too little was."""
    states, targets, known_variance = [], [], []
    for motion, take, target in zip(motions, takes.takes, takes.target(rotation), strict=True):
        measured = np.flatnonzero(np.isfinite(target))
        stated = take.reference_sd_at_frames([rotation])
        states.append(motion.state[measured, row])
        targets.append(target[measured])
        known_variance.append(
            np.zeros(len(measured)) if stated is None else np.nan_to_num(stated[measured, 0]) ** 2
        )
    state, target = np.concatenate(states), np.concatenate(targets)
    if len(target) < LEAST_MEASURED:
        return None
    columns = np.column_stack([np.ones(len(target)), state])
    solved = np.linalg.lstsq(columns, target, rcond=None)[0]
    left = float(np.mean((target - columns @ solved) ** 2) - np.mean(np.concatenate(known_variance)))
    weights = solved[1:]
    spread = [np.einsum("nij,i,j->n", motion.covariance[:, row], weights, weights) for motion in motions]
    variance = max(left - float(np.mean(np.concatenate(spread))), LEAST_VARIANCE)
    offset, gain, velocity, acceleration = map(float, solved)
    return Lead(offset, gain, velocity, acceleration, variance)
