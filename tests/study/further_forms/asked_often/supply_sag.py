"""Supply sag: readings depend on the recorded supply voltage."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

USUAL_V = 3.8


@form(
    Stage.COUNTS,
    "Sensor dividers hang on the battery, the converter has a fixed reference: counts go with the volts.",
    only_by_name=True,
    shared=True,
    sizes=(0.003, 20.0),
)
def dividers_on_battery(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size 1: the voltage behind a reading is in proportion to the supply."""
    gain = size * (scene.supply_v[:, :, None] / USUAL_V - 1)
    return signal + gain * (signal + scene.counts_zero_deg)


@form(
    Stage.ELECTRICAL,
    "Finite supply rejection of amplifiers: each zero moves in proportion to supply (data sheets, PSRR).",
    only_by_name=True,
)
def poor_supply_rejection(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """So many degrees per volt, in a direction of its own for each sensor."""
    return signal + size * draws.signs() * (scene.supply_v[:, :, None] - USUAL_V) * 5.0


@form(
    Stage.COUNTS,
    "The regulator drops out when the battery is low: below a knee excitation falls with it (LDO).",
    only_by_name=True,
    shared=True,
    sizes=(0.003, 20.0),
)
def regulator_drops_out(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size 1: below the knee the excitation falls as the supply does; the knee is rounded."""
    knee_v, rounding_v = draws.one("knee_v", 3.9, 4.05), 0.06
    missing_v = rounding_v * np.logaddexp(0.0, (knee_v - scene.supply_v[:, :, None]) / rounding_v)
    return signal - size * missing_v / knee_v * (signal + scene.counts_zero_deg)


FORMS = (dividers_on_battery, poor_supply_rejection, regulator_drops_out)
