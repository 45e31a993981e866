"""Sensor fault: one sensor fails at times of its own.

One bit of its converter sticks, its wire touches the next one's, or sparks charge its input.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.CONVERTER,
    "One data line of the converter sticks at high for stretches, which adds its weight (stuck-at fault).",
    set_aside=True,
    touches="one",
    sizes=(0.03, 20.0),
)
def bit_sticks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Within stretches, the reading is too high by one bit's weight wherever that bit should be low."""
    weight = np.maximum(size, 1e-6)
    shift = draws.each("shift", 0.0, 1.0)
    low = np.floor(signal / weight + shift) % 2 == 0
    return signal + size * low * _failing(signal, scene, draws, draws.one("lasts_s", 1.5, 5.0))


@form(
    Stage.CONVERTER,
    "Worn insulation lets the wire touch that of the next sensor for stretches (short between two dividers).",
    set_aside=True,
    touches="one",
)
def touches_next_wire(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Within stretches, the reading is drawn towards that of the next sensor."""
    place = np.arange(signal.shape[2])
    other = signal[:, :, np.where(place + 1 < len(place), place + 1, place - 1)]
    touching = _failing(signal, scene, draws, draws.one("lasts_s", 0.5, 3.0))
    return signal + size * 0.1 * touching * (other - signal)


@form(
    Stage.CONVERTER,
    "Sparks of dry cloth charge the input, and the charge leaks off within a second (electrostatic discharge).",
    set_aside=True,
    touches="one",
)
def sparks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """At random moments the reading is kicked up or down and comes back exponentially."""
    every, leaks = draws.one("every_s", 3.0, 8.0), draws.one("leaks_s", 0.3, 1.2)
    keep = np.exp(-1 / (leaks * scene.rate_hz))
    kicks = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("kicks", start.key)
        struck = random.random(kicks.shape[1:]) < 1 / (every * scene.rate_hz)
        kicks[take] = (
            struck * random.choice([-1.0, 1.0], struck.shape) * random.uniform(0.4, 1.6, struck.shape)
        )
    return signal + size * 4 * np.asarray(lfilter([1.0], [1.0, -keep], kicks, axis=1))


def _failing(signal: np.ndarray, scene: Scene, draws: Draws, lasts_s: float) -> np.ndarray:
    """1 in stretches of failure, 0 in those twice as long between them, for every sensor by itself."""
    failing = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("stretches", start.key)
        for sensor in range(signal.shape[2]):
            lengths = random.exponential([2 * lasts_s, lasts_s], (400, 2)).ravel()
            changes = scene.time_s[0] + lengths.cumsum()
            failing[take, :, sensor] = np.searchsorted(changes, scene.time_s) % 2
    return failing


FORMS = (bit_sticks, touches_next_wire, sparks)
