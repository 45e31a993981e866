"""Set-aside forms of a sensor that reads differently while something presses on it."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.contact_pressure import contact_column
from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Padding gives way with the two-thirds power of the force (Hertz 1882).",
    set_aside=True,
    column=contact_column,
)
def hertz(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Degrees in proportion to the depth of a round fingertip in its padding."""
    _, newtons = contact_column(scene, draws)
    weight = draws.each("hertz_weight", 0.6, 1.4) * draws.signs("hertz_signs")
    return signal + size * weight * np.maximum(newtons, 0.0)[..., None] ** (2 / 3)


@form(
    Stage.MECHANICAL,
    "Little at a light touch, then a steep rise and a limit (curve of Hill 1910, as of foam that closes).",
    set_aside=True,
    column=contact_column,
)
def foam_closes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A power of the force over one plus that power."""
    _, newtons = contact_column(scene, draws)
    half_n = draws.each("foam_half_n", 1.5, 4.0)
    steep = draws.each("foam_steep", 2.0, 4.0)
    power = (np.maximum(newtons, 0.0)[..., None] / half_n) ** steep
    return signal + size * 3 * draws.signs("foam_signs") * power / (1 + power)


@form(
    Stage.MECHANICAL,
    "Pressure flattens the sensor of a straight finger and folds that of a bent one (buckling; ours).",
    set_aside=True,
    column=contact_column,
)
def flattens_or_folds(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The force times a half wave over the bend, which changes its sign in mid-range."""
    _, newtons = contact_column(scene, draws)
    turns = draws.each("fold_turns", 0.35, 0.6)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    return signal + size * np.sin(np.pi * (bend - turns)) * newtons[..., None]


FORMS = (hertz, foam_closes, flattens_or_folds)
