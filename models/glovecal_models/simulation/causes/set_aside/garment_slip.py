"""Garment slip: the glove moves on the hand while it is worn, and stays so until the next donning.

A seam that ravels, cloth that sags from straight fingers, or a sheath that turns round its finger.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.WEARING,
    "A seam ravels stitch by stitch, quicker and quicker, as each one lost loads the next more (ours).",
    set_aside=True,
)
def seam_ravels(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All sensors move on by a step with each stitch, and stitches follow each other ever sooner."""
    quickens = _per_wearing(scene, draws, "quickens_s", 150.0, 350.0)[:, None]
    stitches = draws.one("stitches", 4.0, 9.0)
    own = draws.each("own", 0.6, 1.4) * draws.signs()
    gone = np.expm1(_worn(scene) / quickens) / np.expm1(600.0 / quickens)
    return signal + size * 3 * own * (np.floor(stitches * gone + 0.5) / stitches)[:, :, None]


@form(
    Stage.WEARING,
    "Cloth grown slack sags from straight fingers, with the root of the time worn (diffusive give; ours).",
    set_aside=True,
)
def sags_when_straight(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Below a certain bend each sensor falls off, by more and more since donning."""
    below = draws.each("below_bend", 0.35, 0.6)
    pace = _per_wearing(scene, draws, "pace", 0.6, 1.4)[:, None]
    slack = pace * np.sqrt(_worn(scene) / 600.0)
    bend = (signal - scene.low) / scene.span
    return signal + size * 8 * draws.signs() * slack[:, :, None] * np.maximum(below - bend, 0.0)


@form(
    Stage.WEARING,
    "A finger's sheath turns slowly round it, so that the strip sees the bend by the cosine (geometry; ours).",
    set_aside=True,
)
def sheath_turns(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sheath turns from where it was put on, one way or the other, and swings a little on its way."""
    swing_s, own = draws.one("swing_s", 90.0, 200.0), draws.each("own", 0.5, 1.0)
    rate = _per_wearing(scene, draws, "turn", 0.7, 1.5)[:, None]
    worn = _worn(scene)
    turned = rate * (worn / 600.0 + 0.25 * np.sin(2 * np.pi * worn / swing_s))
    seen = np.cos(np.clip(turned[:, :, None] * own, -1.5, 1.5)) - 1
    return signal + size * 8 * (signal - scene.low) / scene.span * seen


def _worn(scene: Scene) -> np.ndarray:
    """Seconds since donning, between putting on and half an hour."""
    return np.clip(scene.since_donned_s, 0.0, 1800.0)


def _per_wearing(scene: Scene, draws: Draws, name: str, low: float, high: float) -> np.ndarray:
    """One number for every take, the same within a wearing."""
    return np.array([draws.stream(name, start.wearing).uniform(low, high) for start in scene.starts])


FORMS = (seam_ravels, sags_when_straight, sheath_turns)
