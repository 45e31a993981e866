"""Training takes as effects and regressors need them, prepared once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.effect_correction import SignalScale
from glovecal_models.effects.base.signals import Signals
from glovecal_models.layout import Correspondence, Layout
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
