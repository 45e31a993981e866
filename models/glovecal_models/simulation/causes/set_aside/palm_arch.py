"""Palm arch: cupping the palm pulls on sensors near it, beside their own joints.

The cloth folds bit by bit, sticks to the palm, or is slackened by the finger's own bend.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Folds spring up across the palm one by one, each of which lets go what the arch has pulled (ours).",
    set_aside=True,
    touches="palm",
)
def folds_one_by_one(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull rises with the arch and falls back at once whenever another fold springs up."""
    folds = draws.each("folds", 1.8, 3.5)
    first = draws.each("taken_before", 0.1, 0.6)
    taken = first + folds * scene.bent("PALM_ARCH")[:, :, None]
    return signal + size * 4 * draws.signs() * (taken % 1.0)


@form(
    Stage.MECHANICAL,
    "Damp cloth sticks to the palm and is taken along only once the arch has moved some way (Coulomb; ours).",
    set_aside=True,
    touches="palm",
)
def sticks_to_palm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The pull follows the arch behind a slack, whichever way the arch moves."""
    slack = draws.each("slack", 0.08, 0.2)
    arch = scene.bent("PALM_ARCH")[:, :, None]
    out = np.empty_like(signal)
    place = np.repeat(arch[:, 0], signal.shape[2], axis=1)
    for frame in range(signal.shape[1]):
        place = np.clip(place, arch[:, frame] - slack, arch[:, frame] + slack)
        out[:, frame] = place
    return signal + size * 4 * draws.signs() * out


@form(
    Stage.MECHANICAL,
    "A bent finger gives cloth to the palm, so only the arch beyond what it gave can pull (ours).",
    set_aside=True,
    touches="palm",
)
def finger_gives_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch pulls only as far as it exceeds a share of the sensor's own bend."""
    given = draws.each("given", 0.3, 0.8)
    bend = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    beyond = np.maximum(scene.bent("PALM_ARCH")[:, :, None] - given * bend, 0.0)
    return signal + size * 4 * draws.signs() * beyond


FORMS = (folds_one_by_one, sticks_to_palm, finger_gives_cloth)
