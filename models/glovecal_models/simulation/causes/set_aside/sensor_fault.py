"""Sensor fault: one sensor's reading fails at times of its own, while the others are right.

A defect in a contact switches to and fro, an amplifier begins to oscillate, a capacitor loses its charge.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


@form(
    Stage.CONVERTER,
    "A defect switches the reading to and fro between two levels at random (random telegraph noise).",
    set_aside=True,
    touches="one",
)
def telegraph(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two levels, each left again after a random time with a mean of its own."""
    high_s, low_s = draws.one("high_s", 0.4, 2.0), draws.one("low_s", 0.8, 4.0)
    raised = np.empty(signal.shape[:2])
    for row, start in enumerate(scene.starts):
        random = draws.stream("switches", start.key)
        stays = random.exponential(1.0, 2000) * np.tile([high_s, low_s], 1000)
        turn = np.searchsorted(np.cumsum(stays), scene.time_s - scene.time_s[0])
        raised[row] = turn % 2 == 0
    return signal + size * draws.sign() * 2 * raised[:, :, None]


@form(
    Stage.CONVERTER,
    "A loose capacitor lets the sensor's amplifier oscillate for stretches; sampled as a slow beat.",
    set_aside=True,
    touches="one",
)
def oscillates(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A sine that grows, holds and dies away again, at a frequency of its own that shifts with the level."""
    beat_hz = draws.one("beat_hz", 1.5, 9.0)
    lasts_s, level = draws.one("lasts_s", 1.0, 3.0), draws.one("level", 0.2, 0.8)
    swing = np.empty(signal.shape[:2])
    for row, start in enumerate(scene.starts):
        random = draws.stream("bursts", start.key)
        loose = lasting_noise(random, len(scene.time_s), 1, lasts_s, scene.rate_hz)[:, 0]
        alive = np.clip((loose - level) / 0.2, 0, 1)
        swing[row] = alive * np.sin(2 * np.pi * beat_hz * scene.session_s[row] + 0.5 * loose)
    return signal + size * 3 * swing[:, :, None]


@form(
    Stage.CONVERTER,
    "A cracked capacitor loses its charge and is charged anew at random moments: uneven saw teeth (ours).",
    set_aside=True,
    touches="one",
)
def loses_charge(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """After every charging the reading sinks away with one time until it is charged again."""
    every_s, sinks_s = draws.one("every_s", 2.0, 7.0), draws.one("sinks_s", 1.0, 6.0)
    sunk = np.empty(signal.shape[:2])
    for row, start in enumerate(scene.starts):
        random = draws.stream("charges", start.key)
        moments = np.cumsum(random.exponential(every_s, 400)) - every_s
        times = scene.time_s - scene.time_s[0]
        last = np.searchsorted(moments, times) - 1
        since = times - np.where(last < 0, 0.0, moments[np.maximum(last, 0)])
        sunk[row] = -np.expm1(-since / sinks_s)
    return signal + size * draws.sign() * 3 * sunk[:, :, None]


FORMS = (telegraph, oscillates, loses_charge)
