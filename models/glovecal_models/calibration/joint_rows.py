"""What the weights of effects are fitted to: signals of lanes, rows of each joint's base, and the fit."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.calibration.held_out import (
    BaseFeatures,
    Rows,
    WeightPosterior,
    weight_posterior,
    with_precision,
)
from glovecal_models.calibration.own_signal import OwnSignal
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.signals import Signals
from glovecal_models.layout import Correspondence


def signals_of_lanes(
    takes: PreparedTakes,
    effect: Effect,
    lanes: Sequence[str],
    columns: Mapping[str, Correspondence],
    own: Mapping[str, OwnSignal],
) -> list[Signals]:
    values = [np.column_stack(parts) for parts in zip(*(own[name].takes for name in lanes), strict=True)]
    without = frozenset(columns[lanes[0]].sensors) if effect.one_joint_at_a_time else frozenset()
    return takes.signals(values, np.array([own[name].zero_deg for name in lanes]), without)


def base_rows(
    takes: PreparedTakes, correspondence: Correspondence, rows: Sequence[np.ndarray], linear: bool
) -> list[Rows]:
    inputs = takes.inputs(correspondence)
    features = BaseFeatures.fit_constants(inputs, linear=linear)
    units = [
        Rows(features.columns(part[index]), target[index])
        for part, target, index in zip(inputs, takes.target(correspondence.rotation), rows, strict=True)
    ]
    stated = [take.reference_sd_at_frames([correspondence.rotation]) for take in takes.takes]
    variance = [
        None if part is None or not np.isfinite(part[index, 0]).all() else part[index, 0] ** 2
        for part, index in zip(stated, rows, strict=True)
    ]
    return with_precision(units, variance)


def joint_weights(
    base: list[Rows], extra: list[list[np.ndarray]], priors: list[np.ndarray]
) -> list[WeightPosterior]:
    """For each effect of one joint, all fitted together."""
    together = [np.column_stack(parts) for parts in zip(*extra, strict=True)]
    whole = weight_posterior(base, together, np.concatenate(priors))
    ends = np.cumsum([0, *(len(part) for part in priors)])
    return [whole.part(slice(start, end)) for start, end in itertools.pairwise(ends)]
