"""Labelled photographs to learn the glove's colours from, where nobody has labelled real ones: simulated."""

from __future__ import annotations

import numpy as np

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.pattern import Pattern
from glovecal_models.colour_glove.pose.hand_motion import hand_motion
from glovecal_models.colour_glove.skin import HandSkin
from glovecal_models.simulation.colour_glove.photograph import Photograph, Photographer, Photography

PICTURES = 8
"""As many as the paper labelled by hand (section 5.1)."""


def labelled_photographs(
    skin: HandSkin, pattern: Pattern, camera: Camera, *, count: int = PICTURES, seed: int = 1
) -> list[Photograph]:
    """Each of another pose, in another room, with another arm, of slightly different exposure."""
    rng = np.random.default_rng([seed, 8])
    found = []
    for index, state in enumerate(hand_motion(skin, 2.0 * count, 0.5, seed=seed)[:count]):
        look = Photography(exposure=float(rng.uniform(0.75, 1.15)), arm=("skin", "sleeve")[index % 2])
        room = int(rng.integers(2**31))
        found.append(Photographer(skin, pattern, camera, look, room).photograph(state))
    return found
