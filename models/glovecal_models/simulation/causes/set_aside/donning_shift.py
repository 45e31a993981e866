"""Set-aside forms of a glove that sits differently each time it is put on and stays so until taken off."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _per_wearing(scene: Scene, draws: Draws, name: str, count: int) -> np.ndarray:
    """Normal numbers that are the same in all takes of one wearing, shape (T, 1, count)."""
    return np.stack([draws.stream(name, start.wearing).standard_normal((1, count)) for start in scene.starts])


@form(
    Stage.WEARING,
    "A finger not pushed home leaves slack per wearing that shows when straight, not when bent (ours).",
    set_aside=True,
)
def loose_when_straight(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The wearing's shift of each sensor falls exponentially from the straight end of its range."""
    used_up = draws.each("used_up", 0.15, 0.5)
    slack = _per_wearing(scene, draws, "slack", signal.shape[-1])
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.3)
    return signal + size * 2 * slack * np.exp(-bend / used_up)


@form(
    Stage.WEARING,
    "One number per wearing, how far the glove is pulled on, shifts and stretches all sensors (ours).",
    set_aside=True,
)
def pulled_on_how_far(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All sensors move with one common depth, each with its own weight, more so when bent."""
    weight = draws.each("weight", 0.5, 1.5) * draws.signs()
    grows = draws.each("grows", -0.6, 1.0)
    depth = _per_wearing(scene, draws, "depth", 1)
    bend = (signal - scene.low) / scene.span
    return signal + size * weight * depth * (1 + grows * bend)


@form(
    Stage.WEARING,
    "The knuckle lies under another part of the sensor per wearing: a step in its answer moves (ours).",
    set_aside=True,
)
def knuckle_elsewhere(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A sigmoid over the bend whose place and height are drawn for each wearing."""
    width = draws.each("width", 0.1, 0.2)
    height = _per_wearing(scene, draws, "height", signal.shape[-1])
    place = 0.45 + 0.15 * np.clip(_per_wearing(scene, draws, "place", signal.shape[-1]), -2.0, 2.0)
    bend = (signal - scene.low) / scene.span
    return signal + size * 1.5 * height * np.tanh((bend - place) / width)


FORMS = (loose_when_straight, pulled_on_how_far, knuckle_elsewhere)
