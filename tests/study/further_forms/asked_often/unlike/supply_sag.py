"""Supply sag: a transistor as a current source, a switch's resistance, and a diode as a reference."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

FULL_V = 4.0


@form(
    Stage.COUNTS,
    "A transistor feeds the sensors by the square of what is above its threshold (Shichman & Hodges 1968).",
    only_by_name=True,
    shared=True,
    sizes=(0.003, 20.0),
)
def current_by_the_square(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Counts in proportion to the current; size is the part of the sensors' feed that goes this way."""
    threshold = draws.one("threshold_v", 2.4, 3.1)
    current = np.maximum((scene.supply_v - threshold) / (FULL_V - threshold), 0.0) ** 2
    return signal + size * (scene.counts_zero_deg + signal) * (current - 1)[:, :, None]


@form(
    Stage.ELECTRICAL,
    "An analogue switch conducts worse at low supply and high signal: one over what is left (CMOS 4051).",
    only_by_name=True,
)
def switch_resistance_rises(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The switch's resistance loads the sensor, in proportion to the signal behind it."""
    threshold, swing = draws.one("threshold_v", 1.4, 1.7), draws.one("swing_v", 1.2, 1.6)
    share = np.clip((signal - scene.low) / scene.span, -0.1, 1.05)
    now = np.maximum(scene.supply_v[:, :, None] - threshold - swing * share, 0.1)
    full = FULL_V - threshold - swing * share
    return signal - size * 20 * (0.1 + share) * (1 / now - 1 / full)


@form(
    Stage.ELECTRICAL,
    "A light-emitting diode serves as reference: its drop is a logarithm of the current (Shockley 1949).",
    only_by_name=True,
)
def diode_as_reference(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move with the logarithm of what the battery has above the diode's drop."""
    drop = draws.one("drop_v", 2.9, 3.25)
    left = np.log(np.maximum(scene.supply_v - drop, 0.05) / (FULL_V - drop))
    return signal + size * draws.signs() * 10 * left[:, :, None]


FORMS = (current_by_the_square, switch_resistance_rises, diode_as_reference)
