"""A CyberGlove that exists only as numbers: angles in, raw counts out, one small object per step between.

    angles -> cloth (couplings) -> sensor curve -> wearing -> counts -> noise -> converter -> readings

Each step turns a signal of shape (N, S) into another of the same shape, row by row. The cloth and the sensor
curve speak in degrees of the measured rotation, everything after ``Counts`` in raw counts. A step with a
memory (hysteresis, creep, lag) fits between sensor curve and wearing and keeps its own state.

Counts per degree and zeros come from public calibration files (``typical_counts.py``), couplings have the
sizes of Wang & Neff 2013, Table 1 (``stretch.py``), noise is that of Kessler et al. 1995 (mean 1.1 degrees)
together with 8-bit steps, and wearings shift by a few degrees (Gracia-Ibanez et al. 2016 found 3.5 degrees
with the same protocol on other days; a single day's wearings are set to a third of that). The shapes of curve
and coupling, and how far gloves differ, are choices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.layout import Layout
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.simulated_hand import SimulatedHand
from glovecal_models.simulation.stretch import bent_share, stretches
from glovecal_models.typical_counts import TYPICAL_COUNTS


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
        self._slack = slack
        self._column = {name: column for column, name in enumerate(sensors)}
        self._stretches = [stretch for stretch in stretches() if stretch.sensor in self._column]
        neighbours = {pull.neighbour for stretch in self._stretches for pull in stretch.pulls}
        self._neighbours = {name: rotations.index(name) for name in neighbours}

    def strain(self, angles: np.ndarray) -> np.ndarray:
        """Shape (N, S) degrees, from ``angles`` of shape (N, len(rotations)), degrees."""
        strain = angles[:, self._own]
        bent = {name: bent_share(name, angles[:, column]) for name, column in self._neighbours.items()}
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


LAYOUTS = ("cyberglove18", "cyberglove22")
ZERO_SD_COUNTS = 13.0
GAIN_LOG_SD = 0.15
LARGEST_BOW = 0.03
NOISE_DEG = 0.9
"""With 8-bit steps of about a degree the sum is near Kessler's 1.1 degrees."""
WEARING_SHIFT_SD_DEG = 0.6
WEARING_SCALE_SD = 0.006


class SimulatedGlove:
    """One glove on one hand in one wearing, fixed by ``seed`` and ``wearing``.

    The same seed is the same glove and hand; another ``wearing`` is the same glove put on again.
    """

    def __init__(self, seed: int = 0, layout: Layout | str = "cyberglove18", *, wearing: int = 0) -> None:
        """``layout`` is cyberglove18 or cyberglove22; raises BadInput for another."""
        self.layout = Layout.built_in(layout) if isinstance(layout, str) else layout
        if self.layout.name not in LAYOUTS:
            meant = did_you_mean(self.layout.name, LAYOUTS)
            raise BadInput(f"no glove of layout {self.layout.name!r} is simulated; {meant}")
        if seed < 0 or wearing < 0:
            raise BadInput(f"seed and wearing are counted from 0, not {seed} and {wearing}")
        self.seed = seed
        self.wearing = wearing
        self.hand = SimulatedHand(seed)
        self._cloth = Cloth(self.layout.sensors, self.layout.rotations)
        self.stages: tuple[SensorStage, ...] = self._build_stages()
        self._random = np.random.default_rng([seed, 4, wearing])

    @property
    def sensors(self) -> tuple[str, ...]:
        return self.layout.sensors

    @property
    def rotations(self) -> tuple[str, ...]:
        return self.layout.rotations

    def readings(self, angles: np.ndarray, random: np.random.Generator | None = None) -> np.ndarray:
        """Raw counts, shape (N, S), of the hand at ``angles``, shape (N, R), degrees, rows in order of time.

        Noise comes from ``random``, else from the glove's own stream, so that frame after frame gives what
        all frames at once give. Raises BadInput for a wrong shape.
        """
        angles = np.asarray(angles, float)
        if angles.ndim != 2 or angles.shape[1] != len(self.rotations):
            raise BadInput(f"angles have shape {angles.shape}, expected (N, {len(self.rotations)})")
        signal = self._cloth.strain(angles)
        for stage in self.stages:
            signal = stage.apply(signal, self._random if random is None else random)
        return signal

    def _build_stages(self) -> tuple[SensorStage, ...]:
        count = len(self.sensors)
        random = np.random.default_rng([self.seed, 2])
        typical_zero, typical_gain = np.array([TYPICAL_COUNTS[name] for name in self.sensors]).T
        low, high = np.array([ACTIVE_RANGE_DEG[name] for name in self.sensors]).T
        zero = typical_zero + ZERO_SD_COUNTS * random.standard_normal(count).clip(-2, 2)
        gain = typical_gain * np.exp(GAIN_LOG_SD * random.standard_normal(count).clip(-2, 2))
        bow = LARGEST_BOW * random.uniform(-1, 1, count)
        donning = np.random.default_rng([self.seed, 3, self.wearing])
        shift = WEARING_SHIFT_SD_DEG * donning.standard_normal(count)
        scale = 1 + WEARING_SCALE_SD * donning.standard_normal(count)
        lowest, highest = self.layout.counts or (1.0, 255.0)
        return (
            SensorCurve(low, high, bow),
            Wearing(shift, scale),
            Counts(zero, gain),
            Noise(NOISE_DEG * np.abs(gain)),
            Converter(lowest, highest),
        )
