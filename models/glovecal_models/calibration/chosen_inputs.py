"""Which sensors a rotation is read from where nobody said it: those that explain takes left out.

Of hardware that nobody knows every sensor may tell every rotation. A Gaussian process over all of them takes
minutes and learns the noise of those that tell nothing, so the inputs are chosen first: sensor by sensor, by
the error of a quadratic map on left-out takes, for as long as one more is worth it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.samples import Samples, gather_samples
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.takes.take import Take

FEWEST_TO_CHOOSE = 5
"""Sensors; a process over fewer is fast enough to be given all."""
MOST_TRIED = 16
"""Sensors beside one another: those that explain most by themselves."""
WORTH_ONE_MORE = 0.02
"""Share of the left-out error that one more sensor has to take away."""
MOST_UNEXPLAINED = 0.2
"""Share of the variance that the chosen sensors may leave: where takes differ by more than noise, as with a
clock that is off, the choice would be of the fault."""
FOLDS = 3
FEWEST_FOR_A_CHOICE = 300
"""With fewer the map of a sensor that tells nothing can win."""
MOST_ROWS = 6000
RIDGE = 1e-6
"""Of a feature's variance."""


def with_chosen_inputs(layout: Layout, unassigned: Collection[str], takes: Sequence[Take]) -> Layout:
    """The layout in which rotations that are ``unassigned`` are read from those of their sensors that explain
    them. Deterministic: the same takes give the same sensors."""
    chosen = tuple(
        _chosen(item, takes)
        if item.rotation in unassigned and item.kind == "MS1R" and len(item.sensors) >= FEWEST_TO_CHOOSE
        else item
        for item in layout.correspondences
    )
    return layout if chosen == layout.correspondences else replace(layout, correspondences=chosen)


def _chosen(item: Correspondence, takes: Sequence[Take]) -> Correspondence:
    samples = gather_samples(takes, item)
    if len(samples) < FEWEST_FOR_A_CHOICE or np.ptp(samples.target) == 0:
        return item
    error = _LeftOutError.of(samples)
    alone = {sensor: error.of_sensors([sensor]) for sensor in range(len(item.sensors))}
    tried = sorted(alone, key=lambda sensor: (alone[sensor], sensor))[:MOST_TRIED]
    kept, left = [tried[0]], alone[tried[0]]
    while len(kept) < len(tried):
        more = {sensor: error.of_sensors([*kept, sensor]) for sensor in tried if sensor not in kept}
        best = min(more, key=lambda sensor: (more[sensor], sensor))
        if more[best] > (1.0 - WORTH_ONE_MORE) ** 2 * left:
            break
        kept, left = [*kept, best], more[best]
    if left > MOST_UNEXPLAINED * error.variance:
        return item
    names = tuple(name for at, name in enumerate(item.sensors) if at in kept)
    return replace(item, sensors=names, kind="1S1R" if len(names) == 1 else "MS1R")


@dataclass(frozen=True)
class _LeftOutError:
    """Mean square error of quadratic maps on the samples that each fold leaves out."""

    inputs: np.ndarray
    """(N, S), standardised."""
    target: np.ndarray
    """(N,)."""
    folds: tuple[np.ndarray, ...]
    """(N,) each, true where a sample is left out."""

    @classmethod
    def of(cls, samples: Samples) -> _LeftOutError:
        rows = samples.select(np.arange(0, len(samples), -(-len(samples) // MOST_ROWS)))
        spread = rows.inputs.std(axis=0)
        inputs = (rows.inputs - rows.inputs.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
        folds = folds_over_takes(rows.take, FOLDS)
        return cls(inputs, rows.target - rows.target.mean(), tuple(fold.held_out for fold in folds))

    @property
    def variance(self) -> float:
        return float(np.var(self.target))

    def of_sensors(self, sensors: Sequence[int]) -> float:
        x = self.inputs[:, sensors]
        first, second = np.triu_indices(x.shape[1])
        features = np.column_stack([np.ones(len(x)), x, x[:, first] * x[:, second]])
        gram, crossed = features.T @ features, features.T @ self.target
        total = 0.0
        for left_out in self.folds:
            own, angles = features[left_out], self.target[left_out]
            kept = gram - own.T @ own
            kept += RIDGE * len(x) * np.eye(len(kept))
            error = angles - own @ np.linalg.solve(kept, crossed - own.T @ angles)
            total += float(error @ error)
        return total / len(x)
