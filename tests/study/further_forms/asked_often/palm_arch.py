"""Palm arch: cupping the palm stretches or bends the finger sensors too."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _arch(scene: Scene) -> np.ndarray:
    """How far the palm is cupped, as a share of its range, shape (T, N, 1)."""
    return scene.bent("PALM_ARCH")[:, :, None]


@form(
    Stage.MECHANICAL,
    "The back of the glove is stretched across the hand in proportion to the palm's arch (linear; ours).",
    only_by_name=True,
    touches="palm",
)
def stretched_glove_back(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A shift in proportion to the arch in degrees."""
    return signal + size * draws.signs() * scene.rotation("PALM_ARCH")[:, :, None] / 10.0


@form(
    Stage.MECHANICAL,
    "A slightly arched palm only takes up slack; the pull grows with the square of the arch (sagitta; ours).",
    only_by_name=True,
    touches="palm",
)
def pull_grows_with_cupping(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The length of an arc over its chord grows with the square of its height; a little grows linearly."""
    linear = draws.each("linear_share", 0.0, 0.2)
    arch = _arch(scene)
    return signal + size * draws.signs() * (linear * arch + (1 - linear) * arch**2)


@form(
    Stage.MECHANICAL,
    "Cupping turns the knuckles, so that a sensor's lever changes: an error that grows with bend (ours).",
    only_by_name=True,
    touches="palm",
)
def turned_knuckle_lever(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch changes the gain about the flat hand and shifts the straight finger a little."""
    base = draws.each("straight_share", 0.1, 0.35)
    own = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    return signal + size * draws.signs() * _arch(scene) * (base + (1 - base) * own)


FORMS = (stretched_glove_back, pull_grows_with_cupping, turned_knuckle_lever)
