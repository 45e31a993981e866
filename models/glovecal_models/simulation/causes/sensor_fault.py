"""Sensor fault: a channel that now and then, or from some time on, tells nothing or something else.

Broken solder, cracked film, a plug that loses contact. Usually one sensor of a glove. The laws are ours.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

STUCK_PER_S = (0.02, 0.06)
DROPPED_PER_S = (0.03, 0.1)
DROPPED_S = 0.1
SPIKES_PER_S = (0.4, 2.0)


@form(
    Stage.CONVERTER,
    "The reading stands still for stretches (firmware that stops sampling a channel).",
    sizes=(0.03, 20.0),
    touches="one",
)
def stuck(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading stands still for a while and jumps back; the size is how long, seconds, in the mean."""
    faulty = _stretches(scene, draws, STUCK_PER_S, size)
    frames = np.arange(signal.shape[1])[None, :, None]
    last = np.maximum.accumulate(np.where(faulty, 0, frames), axis=1)
    return np.take_along_axis(signal, last, axis=1)


@form(Stage.CONVERTER, "Single frames far off (a bad contact, interference).", touches="one")
def spikes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Single frames far off, either way."""
    chance = draws.one("per_s", *SPIKES_PER_S) / scene.rate_hz
    height = np.empty_like(signal)
    for row, start in enumerate(scene.starts):
        random = draws.stream("spikes", start.key)
        hit = random.random(signal.shape[1:]) < chance
        height[row] = (
            hit * random.choice([-1.0, 1.0], signal.shape[1:]) * random.uniform(0.5, 1.5, signal.shape[1:])
        )
    return signal + size * height


@form(
    Stage.CONVERTER,
    "The reading falls towards one end for tenths of a second (a plug that loses contact).",
    touches="one",
)
def dropouts(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Contact is bad for some frames and the reading falls towards one end; size 1 is all the way."""
    end = scene.low - 0.05 * scene.span
    lost = _stretches(scene, draws, DROPPED_PER_S, np.full(len(size), DROPPED_S))
    return signal + size * lost * (end - signal)


@form(
    Stage.CONVERTER,
    "From one moment on the sensor answers differently (a cracked film).",
    touches="one",
)
def gain_jump(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """From one moment in the middle of the session on the sensor answers more or less, for good."""
    at_s = draws.one("at_session_s", 500.0, 1300.0)
    after = (scene.session_s > at_s)[:, :, None]
    return signal + size * draws.signs() * after * (signal - scene.low) / scene.span


def _stretches(
    scene: Scene, draws: Draws, per_second: tuple[float, float], lasts_s: np.ndarray
) -> np.ndarray:
    """Shape (T, N, S): whether a sensor is in a faulty stretch, of ``lasts_s`` (S,) seconds in the mean."""
    shape = scene.own.shape
    faulty = np.empty(shape, bool)
    frames = np.arange(shape[1])[:, None]
    chance = draws.one("per_s", *per_second) / scene.rate_hz
    for row, start in enumerate(scene.starts):
        random = draws.stream("stretches", start.key)
        begins = random.random(shape[1:]) < chance
        length = random.uniform(0.3, 1.7, shape[1:]) * lasts_s * scene.rate_hz
        faulty[row] = frames < np.maximum.accumulate(np.where(begins, frames + length, -1.0), axis=0)
    return faulty


FORMS = (stuck, spikes, dropouts, gain_jump)
