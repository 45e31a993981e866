"""Temperature: readings follow the warmth at the sensor.

The VPL DataGlove was specified for 15 to 40 degrees Celsius only; surface temperature shifts thin-film force
sensors (Tang 2020, Sensors 20(23) 6863). No published degrees per kelvin are known for bend gloves.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Zero points move in proportion to the temperature (temperature coefficient of resistance).",
)
def offset(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """So many degrees per kelvin, all at once."""
    return signal + size * draws.each("per_kelvin", 0.5, 1.5) * draws.sign() * _warmer(scene)


@form(Stage.ELECTRICAL, "Zero points and gains move with the temperature (film and its polymer carrier).")
def offset_and_gain(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero point and gain both change with the warmth."""
    bent = (signal - scene.low) / scene.span
    slope = draws.each("zero", -1.0, 1.0) + draws.signs() * draws.each("gain", 1.0, 2.5) * bent
    return signal + size * slope * _warmer(scene)


@form(
    Stage.ELECTRICAL,
    "Right at one temperature, off above and below (a bridge compensated at room temperature).",
)
def quadratic(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A compensated bridge: right at one temperature, off on both sides of it."""
    off = _warmer(scene) - draws.one("right_at", -1.0, 1.5)
    return signal + size * draws.signs() * off**2


@form(
    Stage.ELECTRICAL,
    "Zero points follow the thermometer one to four minutes later (cloth warms slowly).",
)
def late(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The sensor in the cloth follows the thermometer in the cuff minutes later."""
    time_s = draws.one("late_s", 60.0, 240.0)
    keep = np.exp(-1 / (time_s * scene.rate_hz))
    warmer = _warmer(scene)[:, :, 0]
    rising = (warmer[:, 1:2] - warmer[:, :1]) * scene.rate_hz
    settled = warmer[:, :1] - time_s * rising  # where a steady rise before the scene had left it
    followed = lfilter([1 - keep], [1, -keep], warmer, axis=1, zi=keep * settled)[0]
    return signal + size * draws.signs() * followed[:, :, None]


def _warmer(scene: Scene) -> np.ndarray:
    return (scene.temperature_c - scene.usual_air[0])[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Leakage at the amplifier's input doubles every few degrees (rule of thumb for semiconductor junctions).",
    only_by_name=True,
)
def leakage_doubles(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move exponentially with the temperature."""
    doubles_c = draws.each("doubles_c", 3.0, 7.0)
    warmer = (scene.temperature_c - scene.usual_air[0])[..., None]
    return signal + size * 2 * draws.signs() * np.expm1(np.log(2) * np.minimum(warmer / doubles_c, 4.0))


@form(
    Stage.ELECTRICAL,
    "The polymer carrier softens within a few degrees and then follows its joint less (glass transition).",
    only_by_name=True,
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
    only_by_name=True,
)
def curve_bends(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A skewed parabola over the bend, in proportion to the temperature."""
    skew = draws.each("skew", -0.6, 0.6)
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.1)
    bow = 4 * bend * (1 - bend) * (1 + skew * (2 * bend - 1))
    warmer = (scene.temperature_c - scene.usual_air[0])[..., None]
    return signal + size * draws.signs() * bow * warmer


FORMS = (
    offset,
    offset_and_gain,
    quadratic,
    late,
    leakage_doubles,
    softening,
    curve_bends,
)
