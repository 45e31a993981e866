"""Warm-up drift: trapped charge, leakage of a warming chip, and a diode whose drop shrinks."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Charge trapped in an insulator settles after power-on by a stretched exponential (Kohlrausch 1854).",
    only_by_name=True,
)
def trapped_charge_settles(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Quick at first and long not at an end, for traps of all depths."""
    lasts, stretched = draws.one("lasts_s", 80.0, 300.0), draws.one("stretched", 0.4, 0.65)
    left = np.exp(-((np.maximum(scene.power_on_s, 0.0) / lasts) ** stretched))
    return signal + size * draws.signs() * 5 * left[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Leakage doubles every 8 degrees while the chip warms: a double exponential (Gompertz; junctions).",
    only_by_name=True,
)
def leakage_of_warming_chip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Little at first, then a rise, then it settles with the chip."""
    lasts, warms_c = draws.one("lasts_s", 60.0, 250.0), draws.one("warms_c", 20.0, 40.0)
    cold = np.exp(-np.maximum(scene.power_on_s, 0.0) / lasts)
    leaks = 2.0 ** (-warms_c / 8 * cold)
    return signal + size * draws.signs() * 5 * (leaks - 1)[:, :, None]


@form(
    Stage.ELECTRICAL,
    "A rectifying diode drops more while cold, which weak signals feel most: straight joints (ours).",
    only_by_name=True,
)
def diode_drops_while_cold(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Exponential in the time since power-on, and exponential in the bend."""
    lasts, weak = draws.one("lasts_s", 60.0, 250.0), draws.each("weak_share", 0.2, 0.5)
    cold = np.exp(-np.maximum(scene.power_on_s, 0.0) / lasts)
    felt = np.exp(-np.maximum(signal - scene.low, 0.0) / (weak * scene.span))
    return signal - size * 5 * cold[:, :, None] * felt


FORMS = (trapped_charge_settles, leakage_of_warming_chip, diode_drops_while_cold)
