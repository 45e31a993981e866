"""Nonlinearity: the reading does not go in a straight line with the joint, whatever the time and history.

Potentiometers, optical gratings and strips with two patches each leave a curve of their own.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "A potentiometer whose wiper is loaded: low by the turn squared times what is left (circuit theory).",
    set_aside=True,
    judged_by="straight_line",
)
def loaded_potentiometer(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The wiper of a potentiometer feeds too small a resistance, worst at two thirds of the turn."""
    load = draws.each("load", 0.6, 2.5)
    turn = np.clip(_share(signal, scene), 0, 1)
    loss = turn**2 * (1 - turn) * (1 + load) / (1 + load * turn * (1 - turn))
    return signal - size * draws.sign() * 6.75 * loss


@form(
    Stage.ELECTRICAL,
    "A ripple of a few periods over the range (interpolation error of gratings; Heydemann 1981).",
    set_aside=True,
    judged_by="straight_line",
)
def grating_ripple(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Unequal sine and cosine of a grating leave a ripple with a weaker second harmonic."""
    periods = draws.each("periods", 1.8, 3.4)
    phase = 2 * np.pi * (periods * _share(signal, scene) + draws.each("phase", 0, 1))
    return signal + size * (np.sin(phase) + draws.each("second", 0.2, 0.5) * np.sin(2 * phase))


@form(
    Stage.ELECTRICAL,
    "Two patches on one strip that answer one after the other, with a flatter stretch between them (ours).",
    set_aside=True,
    judged_by="straight_line",
)
def two_patches(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each patch answers while the fold passes it; between them the strip hardly answers."""
    share = _share(signal, scene)
    width = draws.each("width", 0.06, 0.11)
    first = np.tanh((share - draws.each("first", 0.22, 0.34)) / width)
    second = np.tanh((share - draws.each("second", 0.62, 0.78)) / width)
    weight = draws.each("weight", 0.35, 0.65)
    return signal + size * (weight * first + (1 - weight) * second + 1 - 2 * share)


def _share(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return (signal - scene.low) / scene.span


FORMS = (loaded_potentiometer, grating_ripple, two_patches)
