"""Set-aside forms of warmup drift."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "The amplifier warms before its reference resistor does, so the reading runs away and comes back "
    "(two thermal masses; warm-up plots of precision amplifiers, Horowitz and Hill 2015).",
    set_aside=True,
)
def amplifier_before_reference(
    signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws
) -> np.ndarray:
    """A difference of two exponentials: a hump of minutes."""
    quick, slow = draws.each("quick_s", 25.0, 60.0), draws.each("slow_s", 150.0, 400.0)
    on = np.maximum(scene.power_on_s, 0.0)[:, :, None]
    return signal + size * draws.signs() * 5.0 * (np.exp(-on / slow) - np.exp(-on / quick))


@form(
    Stage.ELECTRICAL,
    "Charge soaks into the dielectric of the filter capacitors for minutes after power-on, with a "
    "power of time (Curie 1889; von Schweidler 1907).",
    set_aside=True,
)
def dielectric_soaks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A long tail without a time constant."""
    power, begins = draws.each("power", 0.6, 1.1), draws.each("begins_s", 10.0, 40.0)
    on = np.maximum(scene.power_on_s, 0.0)[:, :, None]
    return signal + size * draws.signs() * 10.0 * (1.0 + on / begins) ** -power


@form(
    Stage.ELECTRICAL,
    "The light source of a fibre sensor loses brightness as its chip warms, and with it the span but "
    "not the zero (thermal droop in LED data sheets).",
    set_aside=True,
)
def lamp_droops(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A gain that falls with the square root of a warming exponential."""
    tau = draws.each("tau_s", 90.0, 300.0)
    on = np.maximum(scene.power_on_s, 0.0)[:, :, None]
    warm = np.sqrt(-np.expm1(-on / tau))
    return signal - size * 8.0 * warm * (signal - scene.low) / scene.span


FORMS: tuple[Form, ...] = (amplifier_before_reference, dielectric_soaks, lamp_droops)
