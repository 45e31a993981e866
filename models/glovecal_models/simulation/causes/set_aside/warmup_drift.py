"""Warm-up drift: the electronics change with the time since power-on, whatever the hand and the air do.

A heater that is regulated rings, heat takes time to arrive, and a lamp burns in.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erfc

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Zero points swing about their rest, ever less, as a heated reference is regulated (damped oscillation).",
    set_aside=True,
)
def regulated_heater(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A damped swing with its own depth per sensor."""
    dies_s, period_s = draws.one("dies_s", 90.0, 220.0), draws.one("period_s", 90.0, 200.0)
    since = _since(scene)
    swing = np.exp(-since / dies_s) * np.cos(2 * np.pi * since / period_s)
    return signal + size * draws.signs() * 2 * swing


@form(
    Stage.ELECTRICAL,
    "Zero points stay at first and move when the heat arrives through the board (erfc; Carslaw & Jaeger).",
    set_aside=True,
)
def heat_arrives(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Heat from a distant source, after a travelling time of its own per sensor."""
    travels_s = draws.each("travels_s", 50.0, 250.0)
    arrived = erfc(np.sqrt(travels_s / np.maximum(_since(scene), 1e-3)))
    return signal + size * draws.signs() * 4 * (arrived - 0.3)


@form(
    Stage.ELECTRICAL,
    "A lamp burns in: all light falls with a power of the time since power-on (light-emitting diodes).",
    set_aside=True,
)
def lamp_burns_in(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each degree counts less as the lamp loses its first brightness."""
    time_s, power = draws.one("time_s", 30.0, 120.0), draws.each("power", 0.4, 1.2)
    bright = (1 + _since(scene) / time_s) ** -power
    light = (signal - scene.low) / scene.span + draws.each("dark", 0.1, 0.4)
    return signal + size * 6 * light * (bright - 0.4)


def _since(scene: Scene) -> np.ndarray:
    return np.maximum(scene.power_on_s, 0)[:, :, None]


FORMS = (regulated_heater, heat_arrives, lamp_burns_in)
