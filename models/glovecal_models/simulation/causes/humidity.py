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


FORMS = (offset, absorbed, sweat)
