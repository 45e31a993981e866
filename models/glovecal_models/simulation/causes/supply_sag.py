"""Supply sag: as the battery empties, all readings shrink together.

A bend sensor is half of a voltage divider: without a reference that follows the supply its counts do. The
whole glove shares one law.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

FULL_V = 4.1


@form(
    Stage.COUNTS,
    "Raw counts go with a power of the supply voltage (voltage divider without its own reference).",
    sizes=(0.003, 20.0),
    shared=True,
)
def gain_power(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Counts go with a power of the voltage; the size is the power."""
    return _scaled(signal, scene, (scene.supply_v / FULL_V) ** size[0])


@form(
    Stage.ELECTRICAL,
    "Zero points and gains change in a straight line with the supply voltage (finite supply rejection).",
)
def offset_and_gain(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points and gains go in a straight line with the voltage, each sensor a little differently."""
    missing = (scene.supply_v - FULL_V)[:, :, None]
    bent = (signal - scene.low) / scene.span
    slope = draws.sign() * (draws.each("zero_deg_per_volt", 0.5, 1.5) + draws.one("gain", 0.5, 1.5) * bent)
    return signal + size * slope * missing


@form(
    Stage.COUNTS,
    "Raw counts fall with the voltage below the regulator's limit, not above (low-dropout regulator).",
    sizes=(0.003, 20.0),
    shared=True,
)
def regulator_dropout(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing happens until the battery is too low for the regulator; from there counts fall with it."""
    limit = draws.one("limit_v", 3.98, 4.05)
    return _scaled(signal, scene, 1 - size[0] * np.maximum(limit - scene.supply_v, 0.0) / limit)


def _scaled(signal: np.ndarray, scene: Scene, share: np.ndarray) -> np.ndarray:
    return (scene.counts_zero_deg + signal) * share[:, :, None] - scene.counts_zero_deg


FORMS = (gain_power, offset_and_gain, regulator_dropout)
