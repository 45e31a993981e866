"""Humidity: the sensor's answer moves with the water in the air of the glove.

Cloth wets faster than it dries, water changes what a capacitor holds, and hygroscopic layers curl.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Zero points follow the humidity: soon while it rises, late while it falls (drying is the slower way).",
    set_aside=True,
)
def dries_slowly(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Water taken up within seconds and given off within minutes."""
    wets_s, dries_s = draws.one("wets_s", 4.0, 15.0), draws.one("dries_s", 60.0, 180.0)
    water = np.empty_like(scene.humidity_pct)
    state = scene.humidity_pct[:, 0]
    for frame in range(water.shape[1]):
        away = scene.humidity_pct[:, frame] - state
        state = state + away * np.where(away > 0, 1 / wets_s, 1 / dries_s) / scene.rate_hz
        water[:, frame] = state
    return signal + size * draws.signs() * 0.5 * (water - scene.usual_air[1])[:, :, None]


@form(
    Stage.ELECTRICAL,
    "A capacitor's filling of fibre, air and water: gains by the cube of mixed cube roots (Looyenga 1965).",
    set_aside=True,
)
def wet_dielectric(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The permittivity of damp cloth sets how much a degree counts."""
    holds = draws.each("holds", 0.1, 0.3)
    damp, usual = scene.humidity_pct[:, :, None] / 100, scene.usual_air[1] / 100
    mixed = (1 + holds * (80 ** (1 / 3) - 1) * damp**2) ** 3
    rest = (1 + holds * (80 ** (1 / 3) - 1) * usual**2) ** 3
    bend = (signal - scene.low) / scene.span
    return signal + size * draws.sign() * 10 * bend * (mixed / rest - 1)


@form(
    Stage.ELECTRICAL,
    "A layer that swells curls the straight strip; a bent strip is held flat against the finger (ours).",
    set_aside=True,
)
def curling_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the humidity times the square of what is left to bend."""
    left = np.clip((scene.high - signal) / scene.span, 0, 1) ** draws.each("power", 1.5, 3.0)
    damp = (scene.humidity_pct - scene.usual_air[1])[:, :, None]
    return signal + size * draws.signs() * damp * left


FORMS = (dries_slowly, wet_dielectric, curling_strip)
