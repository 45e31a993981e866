"""Training takes as effects and regressors need them, prepared once.

The signal of its own that a joint's base gives to the effects on top of it.

What the weights of effects are fitted to: signals of lanes, rows of each joint's base, and the fit.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.effect_correction import SignalScale
from glovecal_models.calibration.held_out import (
    BaseFeatures,
    Rows,
    WeightPosterior,
    weight_posterior,
    with_precision,
)
from glovecal_models.effects.base.effect import CorrectionEffect
from glovecal_models.effects.base.signals import Signals
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.regressor import Regressor
from glovecal_models.takes.take import Take

FITTED_HZ = 30.0
"""Rows on which weights are fitted, at most so many a second: neighbours say nearly the same."""


@dataclass(frozen=True)
class PreparedTakes:
    """Takes of one layout, their reference at the frames, and sensors in standard deviations."""

    takes: tuple[Take, ...]
    layout: Layout
    readings: tuple[np.ndarray, ...]
    """For each take (N, S), in the layout's order."""
    reference: tuple[np.ndarray, ...]
    """For each take (N, R), degrees, in the layout's order of rotations."""
    scale: SignalScale

    @classmethod
    def of(cls, takes: Sequence[Take], layout: Layout) -> PreparedTakes:
        readings = tuple(
            take.readings[:, [take.sensors.index(name) for name in layout.sensors]] for take in takes
        )
        reference = tuple(take.reference_at_frames(layout.rotations) for take in takes)
        every = np.concatenate(readings)
        scale = SignalScale(layout.sensors, every.mean(axis=0), every.std(axis=0))
        return cls(tuple(takes), layout, readings, reference, scale)

    def some(self, index: Sequence[int]) -> PreparedTakes:
        """Some of the takes, with the scale of all."""
        return PreparedTakes(
            tuple(self.takes[i] for i in index),
            self.layout,
            tuple(self.readings[i] for i in index),
            tuple(self.reference[i] for i in index),
            self.scale,
        )

    def target(self, rotation: str) -> list[np.ndarray]:
        """For each take (N,), degrees, NaN where not measured."""
        column = self.layout.rotations.index(rotation)
        return [part[:, column] for part in self.reference]

    def inputs(self, correspondence: Correspondence) -> list[np.ndarray]:
        return [correspondence.input_columns(part, self.layout.sensors) for part in self.readings]

    def rows(self, rotation: str) -> list[np.ndarray]:
        """For each take the frames on which weights are fitted."""
        found = []
        for take, target in zip(self.takes, self.target(rotation), strict=True):
            rate = (len(take.time_s) - 1) / take.duration_s if take.duration_s > 0 else FITTED_HZ
            step = max(1, round(rate / FITTED_HZ))
            found.append(np.flatnonzero(np.isfinite(target))[::step])
        return found

    def signals(
        self, own: Sequence[np.ndarray], zero_deg: np.ndarray, without: frozenset[str]
    ) -> list[Signals]:
        """``own``: for each take (N, L), degrees; ``without``: sensors that the base reads already."""
        result = []
        for take, readings, values in zip(self.takes, self.readings, own, strict=True):
            others = self.scale.others(readings)
            kept = {name: column for name, column in others.items() if name not in without}
            result.append(Signals(take.time_s, values, kept, take.context, take.wearing, take.name, zero_deg))
        return result


@dataclass(frozen=True)
class OwnSignal:
    """What the base says of one rotation."""

    takes: list[np.ndarray]
    """For each take (N,), degrees."""
    zero_deg: float
    """At a raw reading of zero, by a straight line through all takes."""

    @classmethod
    def of(cls, takes: PreparedTakes, correspondence: Correspondence, regressor: Regressor) -> OwnSignal:
        inputs = takes.inputs(correspondence)
        own = [_predicted(regressor, part) for part in inputs]
        x, y = np.concatenate([part[:, 0] for part in inputs]), np.concatenate(own)
        variance = float(np.var(x))
        slope = float(np.mean((x - x.mean()) * (y - y.mean()))) / variance if variance > 0 else 0.0
        return cls(own, float(y.mean() - slope * x.mean()))


def _predicted(regressor: Regressor, inputs: np.ndarray) -> np.ndarray:
    """(N,), degrees; a single sensor's counts come again and again, and each is predicted once."""
    if inputs.shape[1] > 1:
        return regressor.mean(inputs)
    different, which = np.unique(inputs[:, 0], return_inverse=True)
    return regressor.mean(different[:, None])[which]


def signals_of_lanes(
    takes: PreparedTakes,
    effect: CorrectionEffect,
    lanes: Sequence[str],
    columns: Mapping[str, Correspondence],
    own: Mapping[str, OwnSignal],
) -> list[Signals]:
    values = [np.column_stack(parts) for parts in zip(*(own[name].takes for name in lanes), strict=True)]
    without = frozenset(columns[lanes[0]].sensors) if effect.comparison.is_joint_by_joint else frozenset()
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
