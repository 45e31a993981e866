"""A CyberGlove that exists only as numbers: angles in, raw counts out.

It is a simulation. Its counts per degree and zeros come from public calibration files (typical_glove.py),
its couplings have the sizes of Wang & Neff 2013, Table 1 (stretch.py), its noise is that of Kessler et al.
1995 (mean 1.1 degrees) together with 8-bit steps, and its wearings shift by a few degrees (Gracia-Ibanez et
al. 2016 found 3.5 degrees with the same protocol on other days; a single day's wearings are set to a third
of that). The shapes of curve and coupling, and how far gloves differ, are choices.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.layout import Layout
from glovecal_models.simulation.sensor_stages import (
    Cloth,
    Converter,
    Counts,
    Noise,
    SensorCurve,
    SensorStage,
    Wearing,
)
from glovecal_models.simulation.simulated_hand import SimulatedHand
from glovecal_models.simulation.typical_glove import TYPICAL_COUNTS

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
            raise BadInput(
                f"no glove of layout {self.layout.name!r} is simulated; there are {', '.join(LAYOUTS)}"
            )
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
