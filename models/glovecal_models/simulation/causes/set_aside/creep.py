"""Creep: a held bend goes on changing the reading for seconds to minutes, and is forgotten as slowly.

Wet padding drains, filled rubber loses its structure and rebuilds it, and paste flows only beyond a yield.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

MODES = 3


@form(
    Stage.MECHANICAL,
    "Fluid is pressed slowly out of padding and drawn in again (consolidation series of Terzaghi 1925).",
    set_aside=True,
)
def draining_padding(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A series of relaxations with the times of a draining layer: 1, 1/9 and 1/25 of the slowest."""
    slowest = draws.each("slowest_s", 18.0, 45.0)
    drained = np.zeros_like(signal)
    weights = np.array([1 / (2 * mode + 1) ** 2 for mode in range(MODES)])
    for mode, weight in enumerate(weights / weights.sum()):
        drained += weight * _followed(signal, slowest / (2 * mode + 1) ** 2, scene)
    return signal + size * draws.sign() * 0.2 * (drained - scene.low - 0.4 * scene.span)


@form(
    Stage.MECHANICAL,
    "Filled rubber loses its inner structure while bent and rebuilds it slowly (thixotropy; Moore 1959).",
    set_aside=True,
)
def lost_structure(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The intact share of a structure sets how much of the bend is read."""
    breaks, heals = draws.each("breaks_s", 5.0, 14.0), draws.each("heals_s", 15.0, 45.0)
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    broken = np.empty_like(signal)
    state = bend[:, 0] / breaks / (bend[:, 0] / breaks + (1 - bend[:, 0]) / heals)
    for frame in range(signal.shape[1]):
        now = bend[:, frame]
        state = state + ((1 - state) * now / breaks - state * (1 - now) / heals) / scene.rate_hz
        broken[:, frame] = state
    return signal + size * draws.sign() * 10 * bend * (broken - 0.6)


@form(
    Stage.MECHANICAL,
    "A paste that flows only while the bend is more than a yield away from its rest (Bingham 1922).",
    set_aside=True,
)
def yielding_paste(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The paste's rest follows with a time of its own, and only by what exceeds the yield."""
    limit, time_s = draws.each("yield_deg", 6.0, 14.0), draws.each("time_s", 6.0, 18.0)
    rest = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        away = signal[:, frame] - state
        state = state + (away - np.clip(away, -limit, limit)) / (time_s * scene.rate_hz)
        rest[:, frame] = state
    return signal + size * draws.sign() * 0.2 * (rest - scene.low - 0.4 * scene.span)


def _followed(signal: np.ndarray, time_s: np.ndarray, scene: Scene) -> np.ndarray:
    """The signal followed with a first-order lag per sensor, settled at the start."""
    followed = np.empty_like(signal)
    for channel, seconds in enumerate(time_s):
        keep = np.exp(-1 / (seconds * scene.rate_hz))
        column = signal[:, :, channel]
        followed[:, :, channel] = lfilter([1 - keep], [1, -keep], column, axis=1, zi=keep * column[:, :1])[0]
    return followed


FORMS = (draining_padding, lost_structure, yielding_paste)
