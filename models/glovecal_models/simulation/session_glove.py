"""The healthy glove of a simulated session: smooth curves, counts, noise and a little slip.

Every sensor has its own mild monotone curve (a bow, an S, an exponential or a voltage divider) between
degrees and the voltage's scale, which still reads in degrees, and a converter whose range the joint's range
fills by 55 to 70 per cent. What is left unmodelled is what no calibration can remove.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.simulation.protocol import random_posture
from glovecal_models.simulation.scene import Scene, joints
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.simulation.signals import lasting_noise
from glovecal_models.simulation.simulated_glove import Cloth
from glovecal_models.simulation.simulated_hand import DRIVEN, ROTATIONS, SimulatedHand

SLIP_LASTS_S = 25.0
POSTURE_NUISANCE_LASTS_S = 40.0
REFERENCE_NOISE_LASTS_S = 0.3
FILLED_SHARE = (0.55, 0.7)
TRIED_POSTURES = 400
FALLING = ("IM_ABD", "MR_ABD", "RP_ABD")
"""Counts of sensors between fingers fall as the fingers spread."""


class SessionGlove:
    """One glove, fixed by its plan."""

    def __init__(self, plan: SessionPlan) -> None:
        self.plan = plan
        random = np.random.default_rng([plan.seed, 44])
        count = len(plan.sensors)
        played_by = [joints(plan.rotations)[place] for place in plan.own_rotations]
        self._low, high = np.array([ACTIVE_RANGE_DEG[name] for name in played_by]).T
        self._span = high - self._low
        self._form = random.integers(0, 4, count)
        self._bend = random.uniform(0.4, 1.0, count) * random.choice([-1.0, 1.0], count)
        self._cloth = Cloth(played_by, ROTATIONS) if plan.cloth else None
        self.lowest_count, self.highest_count = 1.0, 2.0**plan.bits - 1
        lowest, highest = self._strained(plan.seed)
        room = self.highest_count - self.lowest_count
        sign = np.where([name in FALLING for name in played_by], -1.0, 1.0)
        self.gain = sign * random.uniform(*FILLED_SHARE, count) * room / (highest - lowest)
        """Counts per degree, shape (S,)."""
        middle = (self.lowest_count + self.highest_count) / 2 + random.uniform(-0.05, 0.05, count) * room
        self.zero = middle - self.gain * (lowest + highest) / 2
        """Counts at 0 degrees, shape (S,)."""

    def strain(self, scene: Scene) -> np.ndarray:
        """What bends each sensor, shape (T, N, S), degrees."""
        if self._cloth is None:
            return scene.own.copy()
        takes, times, rotations = scene.hand.shape
        strain = self._cloth.strain(scene.hand.reshape(takes * times, rotations))
        return strain.reshape(takes, times, -1)

    def curve(self, strain: np.ndarray) -> np.ndarray:
        """The sensors' static curves; shape (..., S), degrees of strain to degrees of signal."""
        u = (strain - self._low) / self._span
        inside = np.clip(u, -0.25, 1.25)
        b = self._bend
        bow = inside + 0.06 * b * np.sin(np.pi * inside)
        s_shape = inside - 0.035 * b * np.sin(2 * np.pi * inside)
        exponential = np.expm1(0.45 * b * inside) / np.expm1(0.45 * b)
        divider = inside * (1 + 0.22 * b) / (1 + 0.22 * b * inside)
        shape = np.select([self._form == form for form in range(3)], [bow, s_shape, exponential], divider)
        return self._low + self._span * (shape + (u - inside))

    def slope(self, strain: np.ndarray) -> np.ndarray:
        """How steep the static curves are, same shape, degrees per degree."""
        return (self.curve(strain + 0.05) - self.curve(strain - 0.05)) / 0.1

    def nuisance(self, scene: Scene) -> np.ndarray:
        """The unmodelled remainder of a healthy glove, shape (T, N, S), degrees of signal."""
        takes, times, count = scene.own.shape
        if self.plan.nuisance == "white":
            return np.zeros((takes, times, count))
        lasts_s = SLIP_LASTS_S if self.plan.nuisance == "drift" else POSTURE_NUISANCE_LASTS_S
        slow = np.stack(
            [
                lasting_noise(self._random(45, start.key), times, count, lasts_s, scene.rate_hz)
                for start in scene.starts
            ]
        )
        if self.plan.nuisance == "drift":
            return self.plan.nuisance_deg * slow
        posture = np.tanh(6 * (scene.closing - 0.45))[:, :, None]
        return self.plan.nuisance_deg * slow * posture / 0.75

    def noise(self, scene: Scene) -> np.ndarray:
        """White noise of the sensors at the recorded frames, shape (T, frames, S), degrees of signal."""
        shape = (scene.recorded.stop - scene.recorded.start, len(self.plan.sensors))
        draws = [self._random(46, start.key).standard_normal(shape) for start in scene.starts]
        return self.plan.sensor_noise_deg * np.stack(draws)

    def counts(self, signal: np.ndarray) -> np.ndarray:
        """What the converter sends: whole counts within its range, from degrees of signal."""
        return np.clip(np.rint(self.zero + self.gain * signal), self.lowest_count, self.highest_count)

    def reference_noise(self, key: int, rows: int, rate_hz: float) -> np.ndarray:
        """Noise of the measured angles of one take, shape (rows, R), degrees."""
        random = self._random(47, key)
        count = len(self.plan.rotations)
        white = self.plan.reference_white_deg * random.standard_normal((rows, count))
        lasting = lasting_noise(random, rows, count, REFERENCE_NOISE_LASTS_S, rate_hz)
        return white + self.plan.reference_lasting_deg * lasting

    def floor_deg(self, scene: Scene) -> dict[str, float]:
        """What a perfect static calibration leaves, against the reference: RMS degrees per rotation.

        Noise of sensor and converter and the nuisance, through the curve's slope, plus the reference's own
        noise. Only for rotations with a sensor of their own; neighbours' pulls are taken as known.
        """
        slope = self.slope(self.strain(scene)[:, scene.recorded])
        nuisance = self.nuisance(scene)[:, scene.recorded]
        step = 1 / np.abs(self.gain)
        white = self.plan.sensor_noise_deg**2 + step**2 / 12
        sensor = np.mean((white + nuisance**2) / slope**2, axis=(0, 1))
        reference = self.plan.reference_white_deg**2 + self.plan.reference_lasting_deg**2
        return {
            self.plan.rotations[place]: float(np.sqrt(sensor[sensor_place] + reference))
            for sensor_place, place in enumerate(self.plan.own_rotations)
        }

    def _strained(self, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """How far each sensor is bent at least and at most, shape (S,) each, degrees."""
        low, high = self._low, self._low + self._span
        if self._cloth is None:
            return low, high
        random = np.random.default_rng(53)  # the same postures try out every glove
        postures = np.array([random_posture(random) for _ in range(TRIED_POSTURES)])
        hand = SimulatedHand(seed).complete(dict(zip(DRIVEN, postures.T, strict=True)))
        strain = self._cloth.strain(hand)
        return np.minimum(low, strain.min(axis=0)), np.maximum(high, strain.max(axis=0))

    def _random(self, stream: int, key: int) -> np.random.Generator:
        return np.random.default_rng([self.plan.seed, stream, key])
