"""Donning shift: put on again, the glove sits differently.

With the same protocol on other days the same hand reads 3.5 degrees differently (Gracia-Ibanez et al. 2016,
PMC8178967); Carmel et al. 2014 found 3 degrees per sensor.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(Stage.WEARING, "Each sensor shifted by some degrees per wearing (Gracia-Ibanez et al. 2016).")
def offset(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is shifted by some degrees in each wearing."""
    return signal + size * _per_wearing("offset", scene, draws)


@form(
    Stage.WEARING,
    "Each sensor shifted and stretched per wearing (a sensor further along the finger bends more).",
)
def offset_and_gain(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Shifted, and stretched more or less."""
    bent = (signal - scene.low) / scene.span - 0.4
    stretch = _per_wearing("gain", scene, draws) * draws.one("gain_share", 0.8, 2.5)
    return signal + size * (_per_wearing("offset", scene, draws) + stretch * bent)


@form(
    Stage.WEARING,
    "Each sensor off its joint's axis per wearing, so that the shift changes along the bend.",
)
def posture_dependent(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A sensor that sits off the joint's axis: the shift grows along the bend, in another curve each time."""
    bent = np.clip((signal - scene.low) / scene.span, -0.2, 1.2)
    centre = 0.5 + 0.25 * _per_wearing("centre", scene, draws)
    hump = np.exp(-(((bent - centre) / 0.3) ** 2))
    away = np.sqrt(np.abs(bent)) * _per_wearing("root", scene, draws)
    return signal + size * (_per_wearing("hump", scene, draws) * hump + away)


def _per_wearing(name: str, scene: Scene, draws: Draws) -> np.ndarray:
    """Shape (T, 1, S), standard normal, the same in all takes of a wearing."""
    count = len(scene.sensors)
    drawn = [draws.stream(name, start.wearing).standard_normal(count) for start in scene.starts]
    return np.clip(np.array(drawn), -2.2, 2.2)[:, None, :]


def _drawn_per_wearing(scene: Scene, draws: Draws, name: str, count: int) -> np.ndarray:
    """Normal numbers that are the same in all takes of one wearing, shape (T, 1, count)."""
    return np.stack([draws.stream(name, start.wearing).standard_normal((1, count)) for start in scene.starts])


@form(
    Stage.WEARING,
    "A finger not pushed home leaves slack per wearing that shows when straight, not when bent (ours).",
    only_by_name=True,
)
def loose_when_straight(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The wearing's shift of each sensor falls exponentially from the straight end of its range."""
    used_up = draws.each("used_up", 0.15, 0.5)
    slack = _drawn_per_wearing(scene, draws, "slack", signal.shape[-1])
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.3)
    return signal + size * 2 * slack * np.exp(-bend / used_up)


@form(
    Stage.WEARING,
    "One number per wearing, how far the glove is pulled on, shifts and stretches all sensors (ours).",
    only_by_name=True,
)
def pulled_on_how_far(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All sensors move with one common depth, each with its own weight, more so when bent."""
    weight = draws.each("weight", 0.5, 1.5) * draws.signs()
    grows = draws.each("grows", -0.6, 1.0)
    depth = _drawn_per_wearing(scene, draws, "depth", 1)
    bend = (signal - scene.low) / scene.span
    return signal + size * weight * depth * (1 + grows * bend)


@form(
    Stage.WEARING,
    "The knuckle lies under another part of the sensor per wearing: a step in its answer moves (ours).",
    only_by_name=True,
)
def knuckle_elsewhere(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A sigmoid over the bend whose place and height are drawn for each wearing."""
    width = draws.each("width", 0.1, 0.2)
    height = _drawn_per_wearing(scene, draws, "height", signal.shape[-1])
    place = 0.45 + 0.15 * np.clip(_drawn_per_wearing(scene, draws, "place", signal.shape[-1]), -2.0, 2.0)
    bend = (signal - scene.low) / scene.span
    return signal + size * 1.5 * height * np.tanh((bend - place) / width)


FORMS = (
    offset,
    offset_and_gain,
    posture_dependent,
    loose_when_straight,
    pulled_on_how_far,
    knuckle_elsewhere,
)
