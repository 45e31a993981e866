"""The equations of a template as one linear map: from its scales and offsets to the angles of a hand.

Readings are counted from the middle of each sensor's range in shares of it, so that a scale is the rotation's
angle over that range, in degrees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.template import PALM_SHARE, PINKY, THUMB
from glovecal_models.hand.rotations import FLAT_PALM_DEG, PALM, REST_DEG, RULES


@dataclass(frozen=True)
class TemplateEquations:
    """Of ``rotations`` that each follow the sensor of their name, over readings of ``sensors``."""

    rotations: tuple[str, ...]
    sensors: tuple[str, ...]
    middle: np.ndarray
    """(S,), counts."""
    span: np.ndarray
    """(S,), counts."""

    @property
    def parameters(self) -> tuple[tuple[str, str], ...]:
        """(rotation, sensor or "" for its offset) of each."""
        own = [(name, part) for name in self.rotations for part in (name, "")]
        gain = [(THUMB, PALM)] if self.has_palm and THUMB in self.rotations else []
        return (*own, *gain)

    @property
    def has_palm(self) -> bool:
        return PALM in self.rotations

    def rows(self, rotation: str, readings: np.ndarray) -> tuple[np.ndarray, float]:
        """Angles (N,) are rows (N, P) @ parameters (P,) + a constant, degrees; ``readings`` (N, S).

        A rotation without an equation follows its rule, else rests.
        """
        rows, constant = np.zeros((len(readings), len(self.parameters))), 0.0
        if rotation in self.rotations:
            for column, (name, part) in enumerate(self.parameters):
                if name == rotation:
                    rows[:, column] = self._share(part, readings)
            if rotation == PINKY and self.has_palm:
                rows += PALM_SHARE * self.rows(PALM, readings)[0]
        elif rotation in RULES:
            for name, weight in RULES[rotation].items():
                more, also = self.rows(name, readings)
                rows, constant = rows + weight * more, constant + weight * also
        else:
            constant = FLAT_PALM_DEG if rotation == PALM else REST_DEG[rotation]
        return rows, constant

    def angles(self, rotation: str, readings: np.ndarray, found: np.ndarray) -> np.ndarray:
        """(N,), degrees, with parameters ``found`` (P,)."""
        rows, constant = self.rows(rotation, readings)
        return rows @ found + constant

    def _share(self, sensor: str, readings: np.ndarray) -> np.ndarray:
        if not sensor:
            return np.ones(len(readings))
        column = self.sensors.index(sensor)
        return (readings[:, column] - self.middle[column]) / self.span[column]


def equations_for(
    sensors: Sequence[str], readings: np.ndarray, angles: Mapping[str, Sequence[float]], palm: bool
) -> TemplateEquations:
    """Of rotations whose sensor moves in ``readings`` (N, S) and that are known at two ``angles`` or more."""
    low, high = readings.min(axis=0), readings.max(axis=0)
    told = tuple(
        name
        for name, known in angles.items()
        if name in sensors
        and np.ptp(known) > 0
        and high[list(sensors).index(name)] > low[list(sensors).index(name)]
    )
    chosen = tuple(name for name in told if palm or name != PALM)
    return TemplateEquations(chosen, tuple(sensors), (low + high) / 2, np.maximum(high - low, 1.0))
