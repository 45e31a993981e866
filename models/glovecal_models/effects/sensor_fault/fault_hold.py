"""Rotations whose sensor fails keep their last good angle, and grow uncertain as fast as the joint moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.signature_effect import Held, Hold
from glovecal_models.effects.sensor_fault.fault_watch import FaultLimits, FaultWatch


class FaultHold(Hold):
    """By a ``FaultWatch`` of the readings."""

    def __init__(self, live: Settings, rotations: Sequence[str], sensors: Sequence[str]) -> None:
        """``live``: settings of ``FaultLimits``."""
        limits = FaultLimits.of(live)
        self._sensors = tuple(sensors)
        self._watch = FaultWatch(limits, sensors)
        self._reads = np.zeros((len(rotations), len(sensors)), dtype=bool)
        self._moves = np.zeros((len(rotations), len(limits.move_lag_s)))
        for name, moves, read in zip(limits.rotations, limits.move_deg, limits.reads, strict=True):
            if name in rotations:
                row = list(rotations).index(name)
                self._moves[row] = moves
                self._reads[row, [self._sensors.index(sensor) for sensor in read]] = True
        self._lags = np.array(limits.move_lag_s)
        self._last: np.ndarray | None = None

    def reset(self) -> None:
        self._watch.reset()
        self._last = None

    def frame(self, time_s: float, base: np.ndarray, readings: np.ndarray) -> Held:
        good, age_s = self._watch.frame(time_s, readings)
        fails = age_s > 0.0
        if self._last is None or not fails.any():
            self._last = base.copy()
            return Held(base, readings, np.zeros(len(base)), np.zeros(len(base), dtype=bool), ())
        is_faulty = np.any(self._reads & fails, axis=1)
        self._last = np.where(is_faulty, self._last, base)
        variance = np.zeros(len(base))
        for row in np.flatnonzero(is_faulty):
            oldest = float(age_s[self._reads[row]].max())
            variance[row] = np.interp(oldest, self._lags, self._moves[row]) ** 2
        names = tuple(name for name, failing in zip(self._sensors, fails, strict=True) if failing)
        return Held(self._last, np.where(fails, good, readings), variance, is_faulty, names)
