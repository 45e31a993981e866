"""Donning shift: how the glove sits differs from wearing to wearing and stays so until it is taken off.

A wrinkle is caught under a sensor, a finger's sheath is pulled along, or cloth is stretched before it bends.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.WEARING,
    "A wrinkle is caught somewhere along the bend, elsewhere in every wearing, and lifts the sensor (ours).",
    set_aside=True,
)
def caught_wrinkle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hump of a place, width and height of its own in each wearing."""
    place, width = _worn(scene, draws, "place", 0.2, 0.75), _worn(scene, draws, "width", 0.08, 0.2)
    height = _worn(scene, draws, "height", -1.5, 1.5)
    return signal + size * 2 * height * np.exp(-(((_bend(signal, scene) - place) / width) ** 2))


@form(
    Stage.WEARING,
    "A finger's sheath sits further up or down per wearing: what one joint gains the next one loses (ours).",
    set_aside=True,
)
def sheath_moved(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One number per finger and wearing, with the other sign at every other joint of the finger."""
    fingers = [name.split("_")[0] for name in scene.sensors]
    heads = [fingers.index(finger) for finger in fingers]
    order = np.array([fingers[:place].count(finger) for place, finger in enumerate(fingers)])
    moved = _worn(scene, draws, "moved", -1.5, 1.5)[:, :, heads]
    return signal + size * 2 * np.where(order % 2 == 0, 1.0, -1.0) * draws.each("lever", 0.7, 1.3) * moved


@form(
    Stage.WEARING,
    "Cloth stretched on putting on answers with another power of the bend in each wearing (ours).",
    set_aside=True,
)
def stretched_beforehand(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A power curve per wearing that is right at both ends of the range."""
    bend = np.clip(_bend(signal, scene), 0.0, 1.0)
    power = np.exp(_worn(scene, draws, "power", -0.7, 0.7))
    return signal + size * 10 * (bend**power - bend)


def _worn(scene: Scene, draws: Draws, name: str, low: float, high: float) -> np.ndarray:
    """A number per wearing and sensor, shape (T, 1, S)."""
    sensors = len(scene.sensors)
    drawn = [draws.stream(name, start.wearing).uniform(low, high, sensors) for start in scene.starts]
    return np.stack(drawn)[:, None, :]


def _bend(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return (signal - scene.low) / scene.span


FORMS = (caught_wrinkle, sheath_moved, stretched_beforehand)
