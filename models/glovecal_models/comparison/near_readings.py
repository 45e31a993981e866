"""The noise floor of a table of single poses: frames with nearly the same readings, paired.

Rough, and from above: what the readings still differ by is included.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.comparison.floor_estimate import NoiseFloor, pooled
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import TakeResiduals

MOST_FRAMES = 1500


def from_near_readings(
    takes: Sequence[TakeResiduals],
    column: int,
    generator: np.random.Generator,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> NoiseFloor | None:
    """From pairs of frames of any take; None with fewer than ``fewest_pairs``."""
    error = np.concatenate([item.error[:, column] for item in takes])
    predicted = np.concatenate([item.predicted[:, column] for item in takes])
    names = takes[0].take.sensors
    if any(set(item.take.sensors) != set(names) for item in takes):
        return None
    readings = np.concatenate(
        [item.take.readings[:, [item.take.sensors.index(name) for name in names]] for item in takes]
    )
    rows = np.flatnonzero(np.isfinite(error))
    if len(rows) > MOST_FRAMES:
        rows = np.sort(generator.choice(rows, MOST_FRAMES, replace=False))
    first, second = _nearest_pairs(readings[rows])
    if len(first) < limits.fewest_pairs:
        return None
    first, second = rows[first], rows[second]
    jitter = float(np.sqrt(np.mean((predicted[first] - predicted[second]) ** 2) / 2))
    squares = (error[first] - error[second]) ** 2 / 2
    return pooled(squares, np.ones(len(squares)), jitter, "near readings", generator)


def _nearest_pairs(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both members of each pair: a frame and the one nearest to it, where that is nearer than for most."""
    spread = readings.std(axis=0) if len(readings) else np.zeros(0)
    scaled = readings[:, spread > 0] / spread[spread > 0]
    if len(scaled) < 2 or not scaled.shape[1]:
        return np.empty(0, dtype=int), np.empty(0, dtype=int)
    squares = np.sum(scaled**2, axis=1)
    distance = squares[:, None] + squares[None] - 2 * scaled @ scaled.T
    np.fill_diagonal(distance, np.inf)
    nearest = distance.argmin(axis=1)
    closest = distance[np.arange(len(scaled)), nearest]
    chosen = np.flatnonzero(closest <= np.median(closest))
    pairs = np.unique(np.sort(np.column_stack([chosen, nearest[chosen]]), axis=1), axis=0)
    return pairs[:, 0], pairs[:, 1]
