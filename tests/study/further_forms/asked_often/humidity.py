"""Humidity: readings depend on the recorded humidity."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _damper(scene: Scene) -> np.ndarray:
    """Percent of relative humidity above what is usual in this session, shape (T, N, 1)."""
    return scene.humidity_pct[:, :, None] - scene.usual_air[1]


@form(
    Stage.ELECTRICAL,
    "Polymer takes up water: its resting resistance changes in proportion to humidity (data sheets).",
    only_by_name=True,
)
def moist_resting_resistance(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """So many degrees of angle per percent of humidity."""
    return signal + size * draws.signs() * _damper(scene) / 10.0


@form(
    Stage.ELECTRICAL,
    "Moist textile loses or gains sensitivity in proportion to humidity: off most when bent (ours).",
    only_by_name=True,
)
def moist_sensitivity(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A gain about the lowest angle, in the same direction for all sensors."""
    share = (signal - scene.low) / scene.span
    return signal + size * draws.sign() * share * _damper(scene) / 10.0


@form(
    Stage.ELECTRICAL,
    "Surface leakage beside a high-ohmic sensor grows exponentially with humidity (insulation practice).",
    only_by_name=True,
)
def surface_leakage(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Leakage takes something from every reading, and more from that of a bent sensor (more resistance)."""
    scale = draws.one("scale_pct", 5.0, 10.0)
    more = draws.each("more_when_bent", 0.1, 0.6)
    share = (signal - scene.low) / scene.span
    return signal - size * (1 + more * share) * np.expm1(_damper(scene) / scale)


FORMS = (moist_resting_resistance, moist_sensitivity, surface_leakage)
