"""Sensor fault: a channel that now and then, or from some time on, tells nothing or something else.

Broken solder, cracked film, a plug that loses contact. Usually one sensor of a glove. The laws are ours.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise

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


def _noise(scene: Scene, draws: Draws, name: str, channels: int, lasts_s: float) -> np.ndarray:
    """Noise of its own in every take, shape (T, N, channels)."""
    frames = len(scene.time_s)
    return np.stack(
        [
            lasting_noise(draws.stream(name, start.key), frames, channels, lasts_s, scene.rate_hz)
            for start in scene.starts
        ]
    )


@form(
    Stage.CONVERTER,
    "While a wire is open the floating input wanders by itself, for a share of the time (broken conductor).",
    touches="one",
    sizes=(0.002, 0.95),
    only_by_name=True,
)
def floating_input(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading leaves its joint for some seconds at a time and drifts about some level."""
    channels = signal.shape[-1]
    level = draws.each("level", 0.3, 0.7)
    lasts_s = draws.one("lasts_s", 1.0, 4.0)
    wanders_s = draws.one("wanders_s", 1.0, 5.0)
    wire_open = ndtr(_noise(scene, draws, "contact", channels, lasts_s)) < size
    wanders = scene.low + scene.span * (level + 0.15 * _noise(scene, draws, "wander", channels, wanders_s))
    return np.where(wire_open, wanders, signal)


@form(
    Stage.CONVERTER,
    "A cracked address line of the multiplexer selects another sensor while the hand is closed (ours).",
    touches="one",
    sizes=(0.02, 0.95),
    only_by_name=True,
)
def wrong_channel(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """At times, more often the more the hand is closed, the channel carries the next sensor's reading."""
    lasts_s = draws.one("lasts_s", 1.0, 3.0)
    closed = scene.closing[..., None] + 0.15 * _noise(scene, draws, "crack", 1, lasts_s)
    bend = (signal - scene.low) / scene.span
    other = np.roll(bend, 1, axis=-1) if signal.shape[-1] > 1 else scene.closing[..., None]
    return np.where((size > 0) & (closed > 1 - size), scene.low + scene.span * other, signal)


@form(
    Stage.CONVERTER,
    "Stretches of strong noise from a frayed conductor or shield, quiet in between (contact noise; ours).",
    touches="one",
    only_by_name=True,
)
def crackle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Noise that lasts a few frames, only while a slow random state of the conductor is bad."""
    channels = signal.shape[-1]
    lasts_s = draws.one("lasts_s", 2.0, 6.0)
    crackles_s = draws.one("crackles_s", 0.01, 0.08)
    bad = np.maximum(_noise(scene, draws, "state", channels, lasts_s) - 0.3, 0.0)
    return signal + size * 2 * bad * _noise(scene, draws, "crackle", channels, crackles_s)


FORMS = (
    stuck,
    spikes,
    dropouts,
    gain_jump,
    floating_input,
    wrong_channel,
    crackle,
)
