"""Sensor fault: one sensor is faulty by itself, for moments or for longer."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


@form(
    Stage.CONVERTER,
    "Loose plug: for moments its contact is poor and the reading falls towards that of an open line (ours).",
    only_by_name=True,
    touches="one",
)
def loose_plug(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Dropouts of fractions of a second; size 1 goes all the way to the level of an open line."""
    lasts_s, share = draws.one("lasts_s", 0.1, 0.5), draws.one("share", 0.01, 0.03)
    beyond = 0.1 * scene.span
    level = scene.high + beyond if draws.sign("open_end") > 0 else scene.low - beyond
    fallen = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("contact", start.key)
        contact = lasting_noise(random, signal.shape[1], signal.shape[2], lasts_s, scene.rate_hz)
        fallen[take] = (ndtr(contact) < share) * (level - signal[take])
    return signal + size * fallen


@form(
    Stage.CONVERTER,
    "Cracked conductor: its resistance jumps between two states, staying seconds in each (telegraph noise).",
    only_by_name=True,
    touches="one",
)
def cracked_conductor(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The same step there and back at random times."""
    stays_s = draws.one("stays_s", 1.0, 5.0)
    step = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("crack", start.key)
        flips = random.random(signal.shape[1:]) < 1.0 / (stays_s * scene.rate_hz)
        open_first = random.integers(0, 2, signal.shape[2])
        step[take] = (np.cumsum(flips, axis=0) + open_first) % 2
    return signal + size * draws.signs() * step


@form(
    Stage.CONVERTER,
    "Bad solder joint or broken shield: bursts of strong noise with quiet in between (ours).",
    only_by_name=True,
    touches="one",
)
def bursts_of_noise(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """White noise during bursts of about a second."""
    lasts_s, share = draws.one("lasts_s", 0.5, 2.0), draws.one("share", 0.08, 0.25)
    noise = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("bursts", start.key)
        shield = lasting_noise(random, signal.shape[1], signal.shape[2], lasts_s, scene.rate_hz)
        noise[take] = (ndtr(shield) < share) * random.standard_normal(signal.shape[1:])
    return signal + size * noise


FORMS = (loose_plug, cracked_conductor, bursts_of_noise)
