"""Warm-up drift: readings move while the electronics warms, minutes after power-on, and then rest.

Times of 1 to 15 minutes are our choice of what small electronics in a cuff shows.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Zero points settle with one time after power-on (first-order thermal model of an amplifier).",
)
def one_exponential(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move towards their end with one time."""
    time_s = draws.one("time_s", 60.0, 400.0)
    return signal - size * draws.signs() * np.exp(-_on(scene) / time_s)[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Zero points and gains settle with a fast and a slow time (chip and housing warm separately).",
)
def offset_and_gain(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points and gains move, with a fast and a slow time."""
    fast = np.exp(-_on(scene) / draws.one("fast_s", 40.0, 120.0))[:, :, None]
    slow = np.exp(-_on(scene) / draws.one("slow_s", 300.0, 900.0))[:, :, None]
    share = draws.each("fast_share", 0.3, 0.7)
    gain = draws.each("gain_share", -1.0, 1.0) * (signal - scene.low) / scene.span
    cold = share * fast + (1 - share) * slow
    return signal - size * draws.signs() * cold * (1 + gain)


@form(
    Stage.ELECTRICAL,
    "Zero points move with the logarithm of the time since power-on (no time of its own; ours).",
)
def logarithm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move with the logarithm of the time since power-on and never quite end."""
    start_s = draws.one("start_s", 15.0, 90.0)
    return signal + size * draws.signs() * np.log1p(_on(scene) / start_s)[:, :, None]


def _on(scene: Scene) -> np.ndarray:
    return np.maximum(scene.power_on_s, 0.0)


FORMS = (one_exponential, offset_and_gain, logarithm)
