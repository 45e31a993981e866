"""How much each rotation of a model moves with each sensor, on average over what it was trained on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.regression.regressor import RuleRegressor

INNER_SHARE = 0.25
"""Slopes are taken between this share of a sensor's trained range from below and from above."""
RANGE_IN_SD = 4.0
"""Readings spread over about four of their standard deviations."""


@dataclass(frozen=True)
class SensorSensitivity:
    """L trained rotations, S sensors of the layout."""

    rotations: tuple[str, ...]
    sensors: tuple[str, ...]
    slope: np.ndarray
    """(L, S), degrees per reading; zero for a sensor that the rotation does not read."""
    low: np.ndarray
    """(S,) smallest trained reading; NaN for a sensor that no rotation reads by itself."""
    high: np.ndarray
    centre_deg: np.ndarray
    """(L,): the prediction in the middle of the trained readings."""
    spread_deg: np.ndarray
    """(L,): about one standard deviation of the rotation in training."""

    @property
    def range(self) -> np.ndarray:
        """(S,) trained range in readings, zero where unknown."""
        return np.nan_to_num(self.high - self.low)

    def measuring(self, sensor: str) -> str | None:
        """The rotation that moves most with a sensor, before all the one of its name; None if none does."""
        column = np.abs(self.slope[:, self.sensors.index(sensor)])
        if not column.any():
            return None
        return sensor if sensor in self.rotations else self.rotations[int(np.argmax(column))]


def sensor_sensitivity(model: CalibrationModel) -> SensorSensitivity:
    """From the model alone: the same for whatever is then predicted."""
    trained = [item for item in model.rotations if not isinstance(item.regressor, RuleRegressor)]
    sensors = model.layout.sensors
    low, high = trained_ranges(trained, sensors)
    found = [_of_rotation(item, sensors, low, high) for item in trained]
    return SensorSensitivity(
        tuple(item.rotation for item in trained),
        sensors,
        np.array([slope for slope, _, _ in found]).reshape(-1, len(sensors)),
        low,
        high,
        np.array([centre for _, centre, _ in found]),
        np.array([spread for _, _, spread in found]),
    )


def trained_ranges(trained: Sequence[RotationModel], sensors: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest reading (S,) of each sensor in training; NaN for one that nothing is read from."""
    ranges: Mapping[str, list[tuple[float, float]]] = {name: [] for name in sensors}
    for item in trained:
        for name, low, high in item.trained_ranges:
            if name in ranges:
                ranges[name].append((float(low), float(high)))
    low = [min((low for low, _ in ranges[name]), default=np.nan) for name in sensors]
    high = [max((high for _, high in ranges[name]), default=np.nan) for name in sensors]
    return np.array(low), np.array(high)


def _of_rotation(
    item: RotationModel, sensors: tuple[str, ...], low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, float, float]:
    """Slope (S,) in degrees per reading, prediction in the middle, standard deviation."""
    read = [sensors.index(name) for name in item.correspondence.sensors if name in sensors]
    read = [column for column in read if np.isfinite(low[column]) and high[column] > low[column]]
    middle = np.nan_to_num((low + high) / 2)
    points = np.repeat(middle[None], 1 + 2 * len(read), axis=0)
    for place, column in enumerate(read):
        inner = INNER_SHARE * (high[column] - low[column])
        points[1 + 2 * place, column] = low[column] + inner
        points[2 + 2 * place, column] = high[column] - inner
    angles = item.regressor.predict(item.correspondence.input_columns(points, sensors)).mean
    slope = np.zeros(len(sensors))
    for place, column in enumerate(read):
        apart = points[2 + 2 * place, column] - points[1 + 2 * place, column]
        slope[column] = (angles[2 + 2 * place] - angles[1 + 2 * place]) / apart
    spread = float(np.linalg.norm(slope * np.nan_to_num(high - low)) / RANGE_IN_SD)
    return slope, float(angles[0]), max(spread, 1e-6)
