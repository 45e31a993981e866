"""Cross-coupling: the bend of other joints moves a sensor's reading, at once and whatever their past.

Cloth spans several knuckles, seams run across the back of the hand, and sensors wired as a matrix are read
through each other.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "A band over several knuckles is lifted by the neighbour that is bent most (largest of two; ours).",
    only_by_name=True,
    touches="two",
)
def tallest_knuckle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Only the neighbour that is bent more counts; the other one lies in its shade."""
    before, after = _neighbours((scene.own - scene.low) / scene.span)
    weight = draws.each("weight_after", 0.7, 1.3)
    lifted = np.maximum(before, weight * after)
    return signal + size * draws.signs() * 10.0 * (lifted - 0.5)


@form(
    Stage.MECHANICAL,
    "A seam from joint to joint runs aslant once they part, whichever is ahead (Pythagoras; ours).",
    only_by_name=True,
    touches="two",
)
def seam_runs_aslant(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The seam lengthens with the square of the joints' difference, and in proportion where that is large."""
    bent = (scene.own - scene.low) / scene.span
    other = _neighbours(bent)[1]
    apart = (bent - other) / draws.each("seam_length", 0.15, 0.4)
    return signal + size * draws.signs() * 5.0 * (np.sqrt(1 + np.square(apart)) - 1)


@form(
    Stage.ELECTRICAL,
    "A sneak path through two neighbours in series lies parallel to a sensor read in a matrix"
    " (crossbar readout).",
    only_by_name=True,
    touches="two",
)
def sneak_path(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The conductance of two neighbours one behind the other is added to the own one."""
    conductance = np.maximum(scene.counts_zero_deg + signal, 3.0)
    before, after = _neighbours(conductance)
    path = before * after / (before + after)
    usual = np.maximum(scene.counts_zero_deg + scene.low + 0.4 * scene.span, 3.0)
    one, two = _neighbours(usual)
    return signal + size * 0.3 * (path - one * two / (one + two))


def _neighbours(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The values of the sensors listed before and after each; the last and the first are neighbours too."""
    return np.roll(values, 1, axis=-1), np.roll(values, -1, axis=-1)


FORMS = (tallest_knuckle, seam_runs_aslant, sneak_path)
