"""What happens between a joint's angle and the number a glove sends, one small object per step.

The steps of a simulated sensor, in the order of physics:

    angles -> cloth (couplings) -> sensor curve -> wearing -> counts -> noise -> converter -> readings

Each step turns a signal of shape (N, S) into another of the same shape, row by row. The cloth and the
sensor curve speak in degrees of the measured rotation, everything after ``Counts`` in raw counts. A step
with a memory (hysteresis, creep, lag) fits between sensor curve and wearing and keeps its own state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.simulation.stretch import bent_share, stretches


class SensorStage(Protocol):
    """One step of a simulated sensor."""

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """The signal after this step; ``signal`` and result have shape (N, S), rows in order of time."""
        ...


class Cloth:
    """The first step: what each sensor is bent and stretched by, in degrees, from the hand's rotations.

    The sensor's own rotation, plus its neighbours' pulls (stretch.py). Between two bent fingers the sensor
    also answers less to their spread: ``slack`` times their mean bend is lost. That is a product of three
    angles, beyond any linear map.
    """

    def __init__(self, sensors: Sequence[str], rotations: Sequence[str], slack: float = 0.25) -> None:
        self._own = [rotations.index(name) for name in sensors]
        self._rotations = tuple(rotations)
        self._slack = slack
        self._column = {name: column for column, name in enumerate(sensors)}
        self._stretches = [stretch for stretch in stretches() if stretch.sensor in self._column]

    def strain(self, angles: np.ndarray) -> np.ndarray:
        """Shape (N, S) degrees, from ``angles`` of shape (N, len(rotations)), degrees."""
        strain = angles[:, self._own]
        names = {pull.neighbour for stretch in self._stretches for pull in stretch.pulls}
        bent = {name: bent_share(name, angles[:, self._rotations.index(name)]) for name in names}
        for stretch in self._stretches:
            low, high = ACTIVE_RANGE_DEG[stretch.sensor]
            column = self._column[stretch.sensor]
            if stretch.together:
                both = [bent[pull.neighbour] for pull in stretch.pulls[:2]]
                strain[:, column] *= 1 - self._slack * (both[0] + both[1]) / 2
            strain[:, column] += (high - low) * stretch.share(bent)
        return strain


@dataclass(frozen=True)
class SensorCurve:
    """Static nonlinearity: a sine bow over the active range, at most ``bow`` times the range."""

    low: np.ndarray
    high: np.ndarray
    bow: np.ndarray

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        span = self.high - self.low
        return signal + self.bow * span * np.sin(np.pi * (signal - self.low) / span)


@dataclass(frozen=True)
class Wearing:
    """How the glove sits this time: each sensor shifted by degrees and its answer scaled."""

    shift_deg: np.ndarray
    scale: np.ndarray

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return signal * self.scale + self.shift_deg


@dataclass(frozen=True)
class Counts:
    """From degrees to the converter's scale: counts at 0 degrees and counts per degree."""

    zero: np.ndarray
    gain: np.ndarray

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return self.zero + self.gain * signal


@dataclass(frozen=True)
class Noise:
    """Independent noise of every frame, in counts."""

    sd: np.ndarray

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return signal + self.sd * random.standard_normal(signal.shape)


@dataclass(frozen=True)
class Converter:
    """Rounds to whole counts and holds them within what the hardware can send."""

    lowest: float
    highest: float

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return np.clip(np.rint(signal), self.lowest, self.highest)
