"""Contact pressure: what the hand holds presses on the sensors, in proportion to nothing but the force.

Padding first bulges and then goes flat, glue yields above a force, and a strip bends between two supports.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.contact_pressure import contact_column
from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Light pressure makes the padding bulge under the sensor, stronger pressure flattens it again (ours).",
    set_aside=True,
    column=contact_column,
)
def bulges_then_flattens(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A rise and fall over the force that ends below where it began."""
    ratio = _force(scene, draws) / draws.each("peak_n", 3.0, 6.0)
    return signal + size * draws.signs() * 3 * (1 - draws.each("flat", 0.3, 0.6) * ratio) * ratio * np.exp(
        1 - ratio
    )


@form(
    Stage.MECHANICAL,
    "Stitching holds the strip until a force is exceeded, and gives way in proportion above it (ours).",
    set_aside=True,
    column=contact_column,
)
def gives_way_above(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the force above a threshold, nothing below."""
    over = np.maximum(_force(scene, draws) - draws.each("holds_n", 3.0, 7.0), 0)
    return signal + size * draws.sign() * 0.5 * over


@form(
    Stage.MECHANICAL,
    "A half-bent strip spans a gap and is pressed through, others lie on (three-point bending).",
    set_aside=True,
    column=contact_column,
)
def pressed_through(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The force times a bow over the bend: nothing at both ends of the range."""
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    gap = np.sin(np.pi * bend ** draws.each("power", 0.7, 1.4))
    return signal + size * draws.sign() * 0.4 * _force(scene, draws) * gap**2


def _force(scene: Scene, draws: Draws) -> np.ndarray:
    """The recorded force in newtons, shape (T, N, 1)."""
    return contact_column(scene, draws)[1][:, :, None]


FORMS = (bulges_then_flattens, gives_way_above, pressed_through)
