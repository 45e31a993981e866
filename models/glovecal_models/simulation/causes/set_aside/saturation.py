"""Saturation: over part of the range the readings no longer tell angles apart.

An amplifier turns its output over, a push-pull stage is dead about its middle, and a diode clamps.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.COUNTS,
    "Beyond its input range an amplifier's output turns back (phase reversal of older amplifiers).",
    set_aside=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def phase_reversal(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings stop at an edge and come down again by part of what exceeds it."""
    edge = scene.high - size * scene.span
    over = np.maximum(signal - edge, 0)
    return np.minimum(signal, edge) - draws.each("turned", 0.05, 0.2) * over


@form(
    Stage.COUNTS,
    "A push-pull stage is dead about its middle, where neither half conducts (crossover distortion).",
    set_aside=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def crossover(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing changes within a band about mid-range; outside the band's width is missing."""
    away = signal - scene.low - draws.each("middle", 0.38, 0.5) * scene.span
    half = size * scene.span / 2
    return signal - np.clip(away, -half, half)


@form(
    Stage.COUNTS,
    "A protection diode takes over above its knee, and readings rise with the logarithm (Shockley 1949).",
    set_aside=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def clamping_diode(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Straight up to the knee, a logarithm of what exceeds it above."""
    knee = scene.high - size * scene.span
    scale = draws.each("scale_deg", 0.4, 1.5)
    over = np.maximum(signal - knee, 0)
    return np.minimum(signal, knee) + scale * np.log1p(over / scale)


FORMS = (phase_reversal, crossover, clamping_diode)
