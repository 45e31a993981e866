"""Contact pressure: grips press on the sensors; a recorded column tells the force."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.contact_pressure import _pressure, contact_column
from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "A gripped object pushes on the sensor, whose reading shifts in proportion to the force (linear; ours).",
    only_by_name=True,
    column=contact_column,
)
def pushed_in_proportion(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """So many degrees per newton, in a direction of its own for each sensor."""
    return signal + size * draws.signs() * _pressure(scene, draws) / 10.0


@form(
    Stage.MECHANICAL,
    "Padding under the sensor gives way at light pressure, then hardens: the shift saturates (foam; ours).",
    only_by_name=True,
    column=contact_column,
)
def padding_pressed_flat(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Force over force plus the one that presses the padding half flat."""
    half_n = draws.each("half_n", 2.0, 6.0)
    force = np.maximum(_pressure(scene, draws), 0.0)
    return signal + size * draws.signs() * force / (force + half_n)


@form(
    Stage.MECHANICAL,
    "Pressure clamps the sensor against the finger, and it bends less with the joint: a loss of gain (ours).",
    only_by_name=True,
    column=contact_column,
)
def clamped_against_finger(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The loss is in proportion to force and to the bend, with a small part at the straight finger."""
    base = draws.each("straight_share", 0.05, 0.25)
    share = np.clip((signal - scene.low) / scene.span, 0.0, 1.2)
    return signal - size * (base + (1 - base) * share) * _pressure(scene, draws) / 10.0


FORMS = (pushed_in_proportion, padding_pressed_flat, clamped_against_finger)
