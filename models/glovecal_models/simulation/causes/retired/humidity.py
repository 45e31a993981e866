"""Humidity: readings move with the humidity that the hygrometer shows.

Cloth wets faster than it dries, dry air lets charge stay on the cloth, and two layers that swell unequally
balance at one humidity only.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Fibres take up water quicker than they give it off, and zero points follow the water (sorption"
    " kinetics).",
    only_by_name=True,
)
def wets_quicker_than_dries(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The water runs after the humidity within seconds upwards and within a minute or two downwards."""
    wets = -np.expm1(-1 / (draws.one("wets_s", 4.0, 12.0) * scene.rate_hz))
    dries = -np.expm1(-1 / (draws.one("dries_s", 60.0, 150.0) * scene.rate_hz))
    air = scene.humidity_pct - scene.usual_air[1]
    water = np.empty_like(air)
    state = air[:, 0]
    for frame in range(air.shape[1]):
        missing = air[:, frame] - state
        state = state + np.where(missing > 0, wets, dries) * missing
        water[:, frame] = state
    return signal + size * draws.signs() * draws.each("share", 0.6, 1.4) * water[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Dry air lets charge stay on the cloth, damp air leads it away: exponential in dryness"
    " (triboelectricity).",
    only_by_name=True,
)
def dry_cloth_charges(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move the more steeply the drier the air, and near the bent end half as far again."""
    e_fold = draws.one("e_fold_pct", 2.5, 6.0)
    charge = np.exp(np.clip((scene.usual_air[1] - scene.humidity_pct) / e_fold, -8.0, 4.0))[:, :, None]
    nearer = 1 + 0.5 * np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    return signal + size * draws.signs() * 3.0 * (charge - 1.0) * nearer


@form(
    Stage.ELECTRICAL,
    "Two layers that swell unequally balance at one humidity and curl the strip on both sides of it (ours).",
    only_by_name=True,
)
def layers_balance_once(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing at one humidity, and with the square of the difference above and below."""
    balance = scene.usual_air[1] + draws.one("balance_pct", -1.5, 1.5)
    off = np.square((scene.humidity_pct - balance) / 4.0)[:, :, None]
    return signal + size * draws.signs() * draws.each("share", 0.6, 1.4) * 3.0 * (off - 0.7)


FORMS = (wets_quicker_than_dries, dry_cloth_charges, layers_balance_once)
