"""Set-aside forms of donning shift."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _per_wearing(scene: Scene, draws: Draws, name: str, count: int) -> np.ndarray:
    """Values that are the same in all takes of one wearing, shape (T, 1, count)."""
    return np.stack([draws.stream(name, start.wearing).standard_normal((1, count)) for start in scene.starts])


@form(
    Stage.WEARING,
    "The glove is pushed onto the fingers to another depth each time, so that all strips lie away "
    "from their joints by one common length (repeatability studies, Dipietro, Sabatini and Dario "
    "2008).",
    set_aside=True,
)
def pushed_on_to_another_depth(
    signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws
) -> np.ndarray:
    """One depth for each wearing; an offset and a belly in proportion to it."""
    depth = _per_wearing(scene, draws, "depth", 1)
    bent = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    shape = draws.signs() * draws.each("offset", 0.8, 1.2) + draws.each("belly", -1.5, 1.5) * np.sin(
        np.pi * bent
    )
    return signal + size * 1.5 * depth * shape


@form(
    Stage.WEARING,
    "Each glove finger sits twisted about the finger by an angle of its own, so that a strip beside "
    "the back sees the cosine of the bend's plane (misalignment, Kessler, Hodges and Walker 1995).",
    set_aside=True,
)
def finger_sits_twisted(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A stretch that is smaller the more the finger is twisted, and a shift to the side of the twist."""
    fingers = sorted({name.split("_")[0] for name in scene.sensors})
    column = [fingers.index(name.split("_")[0]) for name in scene.sensors]
    usual = draws.each("usual_rad", -0.4, 0.4)
    twist = usual + 0.4 * _per_wearing(scene, draws, "twist", len(fingers))[:, :, column]
    aside = 3.0 * draws.each("aside", 0.3, 1.0) * (np.sin(twist) - np.sin(usual))
    return signal + size * (aside + 0.4 * (np.cos(twist) - np.cos(usual)) * (signal + 10.0))


@form(
    Stage.WEARING,
    "The wrist strap is closed more or less tightly and pre-stretches the back of the glove, which "
    "shows with an open hand and is used up in a fist (Wise and others 1990).",
    set_aside=True,
)
def strap_tightness(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One tightness for each wearing; an offset that fades with the bend."""
    tightness = _per_wearing(scene, draws, "tightness", 1)
    bent = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    return signal + size * 2.5 * draws.each("felt", 0.6, 1.4) * tightness * (1.0 - bent) ** draws.each(
        "fades", 0.7, 2.0
    )


FORMS: tuple[Form, ...] = (pushed_on_to_another_depth, finger_sits_twisted, strap_tightness)
