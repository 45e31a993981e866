"""Warm-up drift: readings drift with the time since power-on and settle."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _left(scene: Scene, time_s: np.ndarray) -> np.ndarray:
    """The share of warming that is still to come, shape (T, N, S)."""
    return np.exp(-np.maximum(scene.power_on_s, 0.0)[:, :, None] / time_s)


@form(
    Stage.ELECTRICAL,
    "The amplifier's zero settles exponentially as the electronics reach their temperature (Newton's law).",
    only_by_name=True,
)
def settling_zero(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One time constant for the board, a direction and a size for each sensor."""
    time_s = np.full(signal.shape[2], draws.one("time_s", 120.0, 500.0))
    return signal + size * draws.signs() * _left(scene, time_s)


@form(
    Stage.ELECTRICAL,
    "The amplification, or the sensors' excitation, settles exponentially: bent joints are off most (ours).",
    only_by_name=True,
)
def settling_gain(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A gain about the lowest angle that is off at power-on, mostly in one direction for all."""
    share = (signal - scene.low) / scene.span
    time_s = np.full(signal.shape[2], draws.one("time_s", 120.0, 500.0))
    return signal + size * draws.sign() * _left(scene, time_s) * share


@form(
    Stage.ELECTRICAL,
    "The chip warms within a minute, its housing within a quarter of an hour: two time constants (ours).",
    only_by_name=True,
)
def chip_then_housing(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Quick and slow drift of the zero, in the same direction for each sensor."""
    quick = draws.each("quick_share", 0.35, 0.65)
    chip = _left(scene, draws.each("chip_s", 20.0, 60.0))
    housing = _left(scene, draws.each("housing_s", 400.0, 1000.0))
    return signal + size * draws.signs() * (quick * chip + (1 - quick) * housing)


FORMS = (settling_zero, settling_gain, chip_then_housing)
