"""What the glove is expected to read in a step that was not recorded yet.

The measuring sensor follows its rotation and its neighbours; how it does so is learned from the readings with
known angles so far (a Bayesian regression of the sensor on the angle, the inverse of the calibration), and
until there are any it is taken to rise with the angle over its whole range. Neighbours that move freely read
what they read in free motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.layout import Correspondence
from glovecal_models.sampling.active.known_readings import MOTION_ROWS, KnownReadings, spread_rows
from glovecal_models.sampling.step import Step

RISE, RISE_SD, PULL_SD, LEVEL_SD, SCATTER = 1.0, 0.7, 0.6, 0.3, 0.05
"""Of a sensor before anything is known: its rise with the angle, what neighbours do, where its middle is,
how far from it single readings are; all in ranges of the sensor."""
FURTHEST = 0.7
"""From the middle of the range; a half is its end."""


class ExpectedReadings:
    """Learns every measuring sensor from ``known`` once."""

    def __init__(self, known: KnownReadings, correspondences: Sequence[Correspondence]) -> None:
        self._known = known
        self._middle, self._span = (known.low + known.high) / 2, np.maximum(known.high - known.low, 1e-9)
        self._free = (spread_rows(known.free, MOTION_ROWS) - self._middle) / self._span
        self._by_rotation = {item.rotation: item for item in correspondences if item.simulated is None}
        self._learned = {
            name: self._learn(item) for name, item in self._by_rotation.items() if name in known.sensors
        }

    def of(self, step: Step, correspondence: Correspondence) -> np.ndarray:
        """Inputs (m, D), counts, from which ``step`` would give samples of the rotation."""
        if step.motion == "hold":
            unit = np.median(self._free, axis=0)[None]
            for rotation in sorted(step.angles, key=lambda name: len(self._neighbours(name))):
                self._set_own(unit, rotation, step.angles)
        else:
            unit = self._free.copy()
            self._set_own(unit, correspondence.rotation, step.angles)
        readings = self._middle + self._span * unit
        return correspondence.input_columns(readings, self._known.sensors)

    def _set_own(self, unit: np.ndarray, rotation: str, angles: Mapping[str, float]) -> None:
        """The measuring sensor's column in rows ``unit`` (m, S), from angle and neighbours."""
        if rotation not in self._learned:
            return
        weights = self._learned[rotation]
        features = _features(
            _share(rotation, np.array([angles[rotation]])), unit[:, self._neighbours(rotation)]
        )
        unit[:, self._known.sensors.index(rotation)] = np.clip(features @ weights, -FURTHEST, FURTHEST)

    def _neighbours(self, rotation: str) -> list[int]:
        item = self._by_rotation.get(rotation)
        others = () if item is None else item.sensors
        return [self._known.sensors.index(name) for name in others if name != rotation]

    def _learn(self, item: Correspondence) -> np.ndarray:
        """Weights of ``_features``: the posterior mean of the regression."""
        rotation, neighbours = item.rotation, self._neighbours(item.rotation)
        own = self._known.sensors.index(rotation)
        prior = np.array([0.0, RISE, *[0.0] * (2 * len(neighbours))])
        precision = np.array([LEVEL_SD, RISE_SD, *[PULL_SD] * (2 * len(neighbours))]) ** -2.0
        matrix, right = np.diag(precision), precision * prior
        for block in self._known.blocks:
            if rotation not in block.angles:
                continue
            angle = block.angles[rotation]
            measured = np.isfinite(angle)
            unit = (block.readings[measured] - self._middle) / self._span
            features = _features(_share(rotation, angle[measured]), unit[:, neighbours])
            matrix += features.T @ features / SCATTER**2
            right += features.T @ unit[:, own] / SCATTER**2
        return np.linalg.solve(matrix, right)


def _share(rotation: str, angle_deg: np.ndarray) -> np.ndarray:
    """Angle from the middle of the rotation's range, in ranges."""
    low, high = ACTIVE_RANGE_DEG.get(rotation, (0.0, 90.0))
    return (angle_deg - (low + high) / 2) / (high - low)


def _features(share: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
    """[1, angle, neighbours, their squares], shape (m, 2 + 2 K)."""
    rows = max(len(share), len(neighbours))
    columns = [np.ones(rows), np.broadcast_to(share, rows)]
    return np.column_stack([*columns, neighbours, neighbours**2])
