"""Motion and a plain glove to plant effects in: made here, apart from the product's own simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from glovecal_models.effects.base.signals import Signals
from glovecal_models.takes.take import Take

RATE_HZ = 60.0


def motion(generator: np.random.Generator, seconds: float, joints: int) -> np.ndarray:
    """(N, joints) degrees at 60 Hz: random postures, smooth ways between them, rests, tremor, a fast part."""
    frames = round(seconds * RATE_HZ)
    angles, at = np.empty((frames, joints)), 0
    posture = generator.uniform(0, 90, joints)
    while at < frames:
        aim = np.clip(generator.uniform(0, 90) + generator.normal(0, 18, joints), 0, 90)
        moving, resting = (
            round(generator.uniform(0.25, 0.8) * RATE_HZ),
            round(generator.uniform(0, 0.6) * RATE_HZ),
        )
        share = np.linspace(0, 1, moving)[:, None]
        way = posture + (aim - posture) * (10 * share**3 - 15 * share**4 + 6 * share**5)
        piece = np.concatenate([way, np.repeat(aim[None], resting, axis=0)])[: frames - at]
        angles[at : at + len(piece)] = piece
        at, posture = at + len(piece), aim
    fast = slice(frames - frames // 5, frames)
    time = np.arange(frames)[:, None] / RATE_HZ
    angles[fast] += 15 * np.sin(2 * np.pi * 2.5 * time[fast] + np.arange(joints))
    return angles + 0.3 * np.cumsum(generator.normal(0, 0.1, angles.shape), axis=0)


def example_signals(seed: int = 1, seconds: float = 20.0, lanes: int = 3) -> list[Signals]:
    """Two wearings of two takes, with other signals and every context column, at uneven frame times."""
    generator, takes = np.random.default_rng(seed), []
    for number in range(4):
        angles = motion(generator, seconds, lanes + 4)
        frames = len(angles)
        scaled = (angles - angles.mean(axis=0)) / angles.std(axis=0)
        names = ("PALM_ARCH", "T_TMC", "TI_ABD", "I_PIP")
        pressed = np.convolve(generator.random(frames) < 0.01, np.hanning(40), mode="same")
        context = {
            "supply_v": 4.1 - 0.15 * number + 0.02 * generator.normal(size=frames),
            "temperature_c": 24.0 + 3.0 * number + np.linspace(0, 1.0 + 0.7 * number, frames),
            "humidity_pct": 40.0 + 5.0 * np.sin(number + np.linspace(0, 3, frames)),
            "power_on_s": 20.0 + 220.0 * number + np.arange(frames) / RATE_HZ,
            "contact_n": 8.0 * pressed,
        }
        context["temperature_c"][100:110] = np.nan
        time = 5.0 + np.cumsum(generator.uniform(0.6, 1.4, frames)) / RATE_HZ
        others = {name: scaled[:, lanes + column].copy() for column, name in enumerate(names)}
        wearing = "ab"[number // 2]
        motion_name = ("free", "fast")[number % 2]
        takes.append(Signals(time, angles[:, :lanes], others, context, wearing, f"{motion_name}-{wearing}"))
    return takes


@pytest.fixture(scope="session")
def signals() -> list[Signals]:
    return example_signals()


@dataclass(frozen=True)
class PlainGlove:
    """Three sensors at 2 counts a degree, 8 bits, noise in sensors and reference."""

    seed: int = 0
    rotations: tuple[str, ...] = ("I_PIP", "M_PIP", "R_PIP")

    @property
    def sensor_of(self) -> dict[str, str]:
        return {name: name for name in self.rotations}

    def takes(
        self,
        count: int = 4,
        seconds: float = 30.0,
        shape_counts: Callable[[np.ndarray, np.random.Generator], np.ndarray] | None = None,
        noise_deg: float = 0.3,
    ) -> list[Take]:
        """``shape_counts`` distorts the (N, 3) counts before noise and converter."""
        generator, result = np.random.default_rng(self.seed), []
        for number in range(count):
            angles = motion(generator, seconds, len(self.rotations))
            time = np.arange(len(angles)) / RATE_HZ
            counts = 40.0 + 2.0 * angles
            if shape_counts is not None:
                counts = shape_counts(counts, generator)
            counts = np.round(counts + 2.0 * noise_deg * generator.normal(size=counts.shape))
            reference = angles + 0.3 * generator.normal(size=angles.shape)
            result.append(
                Take(
                    f"take{number}", "w1", self.rotations, time, np.clip(counts, 0, 255), self.rotations,
                    time, reference,
                )
            )  # fmt: skip
        return result

    def errors(self, takes: list[Take]) -> list[np.ndarray]:
        """Errors of the right straight line, degrees."""
        return [(take.readings - 40.0) / 2.0 - take.reference for take in takes]


@pytest.fixture
def glove() -> PlainGlove:
    return PlainGlove()


def with_readings(take: Take, readings: np.ndarray) -> Take:
    return replace(take, readings=readings)
