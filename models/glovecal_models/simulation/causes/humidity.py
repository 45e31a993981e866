"""Humidity: damp cloth and sweat change readings.

The VPL DataGlove was specified for 30 to 60 per cent relative humidity. The laws are ours.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(Stage.ELECTRICAL, "Zero points move in proportion to the humidity (leakage of resistive films).")
def offset(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """So many degrees per per cent, all at once."""
    return signal + size * draws.each("per_pct", 0.5, 1.5) * draws.sign() * _damper(scene)[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Zero points and gains follow the air's humidity minutes later (cloth takes it up slowly).",
)
def absorbed(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Cloth takes minutes to take up what the air has; zero point and gain follow it."""
    time_s = draws.one("absorbed_in_s", 60.0, 300.0)
    keep = np.exp(-1 / (time_s * scene.rate_hz))
    damper = _damper(scene)
    rising = (damper[:, 1:2] - damper[:, :1]) * scene.rate_hz
    settled = damper[:, :1] - time_s * rising
    taken_up = lfilter([1 - keep], [1, -keep], damper, axis=1, zi=keep * settled)[0][:, :, None]
    bent = (signal - scene.low) / scene.span
    return signal + size * draws.signs() * taken_up * (1 + draws.each("gain", -0.5, 0.5) * bent)


@form(Stage.ELECTRICAL, "Zero points move only above a humidity (sweat that no longer dries).")
def sweat(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing until it condenses; beyond that every per cent counts."""
    wet = np.maximum(_damper(scene) - draws.one("above_usual_pct", -2.0, 1.0), 0.0)
    return signal + size * draws.signs() * wet[:, :, None]


def _damper(scene: Scene) -> np.ndarray:
    return scene.humidity_pct - scene.usual_air[1]


@form(
    Stage.ELECTRICAL,
    "Zero points follow the water fibres take up, by an isotherm (Guggenheim, Anderson, de Boer).",
    only_by_name=True,
)
def sorption_isotherm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Water content rises steeply in dry air, slowly in the middle and steeply again in damp air."""
    first_layer = draws.each("first_layer", 6.0, 16.0)
    further = draws.each("further", 0.75, 0.88)

    def water(humidity_pct: np.ndarray) -> np.ndarray:
        active = further * np.clip(humidity_pct / 100, 0.02, 0.97)
        return np.asarray(first_layer * active / ((1 - active) * (1 - active + first_layer * active)))

    taken_up = water(scene.humidity_pct[..., None]) - water(np.full(1, scene.usual_air[1]))
    return signal + size * 4 * draws.signs() * taken_up


@form(
    Stage.ELECTRICAL,
    "A damp film leaks in parallel to the sensor: exponential in humidity, quadratic in bend (ours).",
    only_by_name=True,
)
def parallel_leak(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The leak takes away the square of a resistance that grows with the bend."""
    e_fold_pct = draws.each("e_fold_pct", 8.0, 18.0)
    straight = draws.each("straight", 0.2, 0.7)
    bend = np.clip((signal - scene.low) / scene.span, -0.15, 1.3)
    damper = (scene.humidity_pct - scene.usual_air[1])[..., None]
    return signal - size * 2 * (straight + bend) ** 2 * np.expm1(np.minimum(damper / e_fold_pct, 3.0))


@form(
    Stage.ELECTRICAL,
    "A hygroscopic film goes from stiff to swollen around one humidity and answers more when swollen (ours).",
    only_by_name=True,
)
def swollen_film(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The gain goes from one level to another around one humidity."""
    above_usual_pct = draws.each("above_usual_pct", -4.0, 4.0)
    width_pct = draws.each("width_pct", 3.0, 8.0)
    bend = (signal - scene.low) / scene.span
    damper = (scene.humidity_pct - scene.usual_air[1])[..., None]
    return signal + size * 3 * bend * np.tanh((damper - above_usual_pct) / width_pct)


FORMS = (
    offset,
    absorbed,
    sweat,
    sorption_isotherm,
    parallel_leak,
    swollen_film,
)
