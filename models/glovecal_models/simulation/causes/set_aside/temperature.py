"""Temperature: readings follow the air's temperature.

A carrier may change its crystals, light in a fibre may interfere, or a correction may end too early.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "A polymer changes its crystals, and so its volume, at one temperature (as PTFE does at 19 degC).",
    set_aside=True,
)
def crystals_change(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points go from one level to another within tenths of a degree."""
    at = draws.one("from_usual_c", -0.6, 0.6)
    width = draws.each("width_c", 0.1, 0.3)
    state = np.tanh((_warmer(scene) - at) / width)
    return signal + size * draws.signs() * state


@form(
    Stage.ELECTRICAL,
    "Reflections in a fibre interfere, and the fringes walk as the fibre expands (Fabry-Perot).",
    set_aside=True,
)
def fringes_walk(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A wave over the bend whose phase moves with the temperature."""
    along, period = draws.each("fringes", 0.4, 1.6), draws.each("period_c", 1.8, 5.0)
    phase = draws.each("phase", 0.0, 1.0)
    bend = (signal - scene.low) / scene.span
    warmer = _warmer(scene)
    return signal + size * 1.5 * np.sin(2 * np.pi * (along * bend + warmer / period + phase))


@form(
    Stage.ELECTRICAL,
    "Firmware corrects for temperature within a band only, and keeps its last value beyond it (ours).",
    set_aside=True,
)
def correction_ends(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points and gains are right within a band of temperatures and drift off on both sides of it."""
    below, above = draws.one("below_c", 0.2, 0.9), draws.one("above_c", 0.2, 0.9)
    gain = draws.each("gain", 0.0, 0.8)
    warmer = _warmer(scene)
    beyond = warmer - np.clip(warmer, -below, above)
    bend = (signal - scene.low) / scene.span
    return signal + size * draws.signs() * beyond * (1 - gain + gain * bend)


def _warmer(scene: Scene) -> np.ndarray:
    """By how much the air is warmer than usual, shape (T, N, 1)."""
    return (scene.temperature_c - scene.usual_air[0])[:, :, None]


FORMS = (crystals_change, fringes_walk, correction_ends)
