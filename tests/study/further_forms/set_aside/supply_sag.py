"""Set-aside forms of supply sag."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _shrunk(signal: np.ndarray, scene: Scene, size: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """The voltage behind each reading less the share ``size * missing``, (T, N) for all sensors."""
    return signal - size * missing[:, :, None] * (scene.counts_zero_deg + signal)


@form(
    Stage.COUNTS,
    "A linear regulator leaves regulation when the battery comes near its output plus dropout, and "
    "from then on follows it down (dropout curves in regulator data sheets).",
    set_aside=True,
    shared=True,
)
def regulator_below_dropout(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing above a voltage, volt for volt below it."""
    dropout, width = draws.one("dropout_v", 4.03, 4.12), draws.one("width_v", 0.015, 0.04)
    missing = width * np.logaddexp(0.0, (dropout - scene.supply_v) / width)
    return _shrunk(signal, scene, size, missing)


@form(
    Stage.COUNTS,
    "The radio's bursts draw current through the cell's inner resistance, which grows as the cell "
    "empties, so the sag comes in pulses (lithium cell models, Chen and Rincon-Mora 2006).",
    set_aside=True,
    shared=True,
)
def sags_under_radio_bursts(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A steady part and a pulsed part, both larger at lower voltage."""
    every, lasts, phase = (
        draws.one("every_s", 0.8, 3.0),
        draws.one("lasts", 0.2, 0.5),
        draws.one("phase", 0.0, 1.0),
    )
    pulsed = ((scene.session_s / every + phase) % 1.0 < lasts) * draws.one("pulse", 0.3, 1.0)
    return _shrunk(signal, scene, size, np.maximum(4.2 - scene.supply_v, 0.0) ** 1.5 * (1.0 + pulsed))


@form(
    Stage.COUNTS,
    "The lamp of a fibre glove is fed through a resistor, so its light falls with what the supply has"
    " above the forward voltage, raised to a power (LED data sheets; Zimmerman's optical glove 1985).",
    set_aside=True,
    shared=True,
)
def lamp_fed_by_resistor(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All readings follow the light."""
    forward, power = draws.one("forward_v", 1.8, 3.2), draws.one("power", 1.0, 1.6)
    light = (np.maximum(scene.supply_v - forward, 0.05) / (4.2 - forward)) ** power
    return _shrunk(signal, scene, size, 1.0 - light)


FORMS: tuple[Form, ...] = (regulator_below_dropout, sags_under_radio_bursts, lamp_fed_by_resistor)
