"""Set-aside forms of a sensor that reads differently at another temperature."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Leakage at the amplifier's input doubles every few degrees (rule of thumb for semiconductor junctions).",
    set_aside=True,
)
def leakage_doubles(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move exponentially with the temperature."""
    doubles_c = draws.each("doubles_c", 3.0, 7.0)
    warmer = (scene.temperature_c - scene.usual_air[0])[..., None]
    return signal + size * 2 * draws.signs() * np.expm1(np.log(2) * np.minimum(warmer / doubles_c, 4.0))


@form(
    Stage.ELECTRICAL,
    "The polymer carrier softens within a few degrees and then follows its joint less (glass transition).",
    set_aside=True,
)
def softening(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The gain goes from one level to another around one temperature; the straight finger stays right."""
    above_usual_c = draws.each("above_usual_c", -1.5, 1.5)
    width_c = draws.each("width_c", 0.8, 2.5)
    bend = (signal - scene.low) / scene.span
    warmer = (scene.temperature_c - scene.usual_air[0])[..., None]
    return signal - size * 3 * bend * np.tanh((warmer - above_usual_c) / width_c)


@form(
    Stage.ELECTRICAL,
    "The curve bows with the temperature while both ends stay right (unequal arms of a bridge; ours).",
    set_aside=True,
)
def curve_bends(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A skewed parabola over the bend, in proportion to the temperature."""
    skew = draws.each("skew", -0.6, 0.6)
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.1)
    bow = 4 * bend * (1 - bend) * (1 + skew * (2 * bend - 1))
    warmer = (scene.temperature_c - scene.usual_air[0])[..., None]
    return signal + size * draws.signs() * bow * warmer


FORMS = (leakage_doubles, softening, curve_bends)
