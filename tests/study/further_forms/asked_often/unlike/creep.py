"""Creep: a material that ages since donning, one that flows by a power, and a knit that locks up."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _flow(signal: np.ndarray, per_frame: Callable[[np.ndarray, np.ndarray, int], np.ndarray]) -> np.ndarray:
    """What has given, shape (T, N, S): each frame closes a part of what is missing."""
    given, course = signal[:, 0], np.empty_like(signal)
    for frame in range(signal.shape[1]):
        missing = signal[:, frame] - given
        given = given + missing * np.clip(per_frame(missing, given, frame), 0.0, 1.0)
        course[:, frame] = given
    return course


@form(
    Stage.MECHANICAL,
    "The strip ages from donning on: its time to relax grows with a power of the time worn (Struik 1978).",
    only_by_name=True,
)
def slower_with_age(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One relaxation time, seconds after donning and most of a minute when worn long."""
    at_start, power = draws.each("at_start_s", 4.0, 10.0), draws.one("power", 0.6, 0.95)
    age = np.maximum(scene.since_donned_s, 10.0) / 100.0
    lasts = at_start * age[:, :, None] ** power
    course = _flow(signal, lambda missing, given, frame: 1 / (lasts[:, frame] * scene.rate_hz))
    return signal + size * (course - signal)


@form(
    Stage.MECHANICAL,
    "The rate of flow is a power of what is missing, so that the end comes ever more slowly (Norton 1929).",
    only_by_name=True,
)
def flows_by_a_power(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Powers of two and a half to four; the time is that at 40 degrees missing."""
    power, lasts = draws.each("power", 2.5, 4.0), draws.each("lasts_s", 3.0, 10.0)

    def rate(missing: np.ndarray, given: np.ndarray, frame: int) -> np.ndarray:
        return (np.abs(missing) / 40.0) ** (power - 1) / (lasts * scene.rate_hz)

    return signal + size * (_flow(signal, rate) - signal)


@form(
    Stage.MECHANICAL,
    "Loops of a knit lock the more they have given: the rate falls exponentially (strain hardening).",
    only_by_name=True,
)
def knit_locks_up(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A second or two when nothing has given, most of a minute when all has, both ways."""
    locks, lasts = draws.each("locks", 2.5, 3.6), draws.each("lasts_s", 0.8, 2.0)

    def rate(missing: np.ndarray, given: np.ndarray, frame: int) -> np.ndarray:
        return np.exp(-locks * (given - scene.low) / scene.span) / (lasts * scene.rate_hz)

    return signal + size * (_flow(signal, rate) - signal)


FORMS = (slower_with_age, flows_by_a_power, knit_locks_up)
