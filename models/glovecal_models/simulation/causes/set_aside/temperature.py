"""Temperature: the sensor's answer moves with the temperature of the air in the glove.

Crystals have cubic curves, gaps close as parts expand, and bonded layers warp as a bimetal does.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Zero points follow a cubic with two turning points (frequency of AT-cut quartz over temperature).",
    set_aside=True,
)
def quartz_cubic(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A count made against a quartz: down, up and down again over the temperature."""
    scaled = _from_usual(scene) / draws.each("scale_c", 0.7, 1.1) - draws.each("turn", -0.3, 0.3)
    return signal + size * draws.signs() * (scaled**3 / 3 - scaled)


@form(
    Stage.ELECTRICAL,
    "Nothing moves until a gap has closed; from there parts press on each other as they expand (ours).",
    set_aside=True,
)
def gap_closes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the temperature above where the gap closes, nothing below."""
    closes_c = draws.one("closes_c", -0.7, 0.4)
    return signal + size * draws.signs() * 2 * np.maximum(_from_usual(scene) - closes_c, 0)


@form(
    Stage.ELECTRICAL,
    "Two bonded layers warp while the strip is straight; a bend holds them flat (bimetal; Timoshenko 1925).",
    set_aside=True,
)
def bimetal_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the temperature, less and less with the square of the bend."""
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    held = 1 / (1 + (bend / draws.each("half_bend", 0.25, 0.5)) ** 2)
    return signal + size * draws.signs() * 3 * _from_usual(scene) * held


def _from_usual(scene: Scene) -> np.ndarray:
    return (scene.temperature_c - scene.usual_air[0])[:, :, None]


FORMS = (quartz_cubic, gap_closes, bimetal_strip)
