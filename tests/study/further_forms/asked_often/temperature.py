"""Temperature: readings depend on the recorded temperature."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _warmer(scene: Scene) -> np.ndarray:
    """Degrees above the usual temperature of this session, shape (T, N, 1)."""
    return scene.temperature_c[:, :, None] - scene.usual_air[0]


@form(
    Stage.ELECTRICAL,
    "Zero drift in proportion to temperature, as data sheets of sensors and amplifiers state it.",
    only_by_name=True,
)
def zero_temperature_drift(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """So many degrees of angle per degree of temperature."""
    return signal + size * draws.signs() * _warmer(scene) / 5.0


@form(
    Stage.ELECTRICAL,
    "Thermal coefficient of sensitivity: gauge factor changes in proportion to temperature (data sheets).",
    only_by_name=True,
)
def sensitivity_temperature_drift(
    signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws
) -> np.ndarray:
    """A gain about the lowest angle; all sensors are of one material, so all go the same way."""
    share = (signal - scene.low) / scene.span
    return signal + size * draws.sign() * share * _warmer(scene) / 5.0


@form(
    Stage.ELECTRICAL,
    "Carbon-filled polymer conducts better when warm, exponentially (Arrhenius), at rest and more when bent.",
    only_by_name=True,
)
def thermally_activated_conduction(
    signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws
) -> np.ndarray:
    """The exponential acts on the whole resistance: that of the straight sensor and that due to bending."""
    rate = draws.one("per_degree", 0.06, 0.14)
    resting = draws.each("resting", 0.4, 1.0)
    share = (signal - scene.low) / scene.span
    return signal + size * draws.sign() * (resting + share) * np.expm1(rate * _warmer(scene))


FORMS = (zero_temperature_drift, sensitivity_temperature_drift, thermally_activated_conduction)
