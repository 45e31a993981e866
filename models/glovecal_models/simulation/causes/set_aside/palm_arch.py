"""Palm arch: cupping the palm moves the cloth over the knuckles, at once and the same way every time.

The arch is a rotation of the hand that no sensor of the glove sees directly.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Cloth across the back of the hand stiffens as it is stretched by the arch (J-curve; Fung 1967).",
    set_aside=True,
    touches="palm",
)
def stiffening_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """An exponential of the arch, as of collagen and knit: soft at first, then stiff."""
    arch = scene.rotation("PALM_ARCH")[:, :, None]
    scale = draws.each("scale_deg", 5.0, 9.0)
    return signal + size * _side(scene, draws) * 0.3 * np.expm1(arch / scale)


@form(
    Stage.MECHANICAL,
    "The arch lifts the cloth off the knuckle and then draws it down again at its sides (ours).",
    set_aside=True,
    touches="palm",
)
def lifts_then_draws_down(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A rise and fall over the arch, largest at a middling arch."""
    ratio = np.maximum(scene.rotation("PALM_ARCH"), 0)[:, :, None] / draws.each("peak_deg", 5.0, 9.0)
    return signal + size * _side(scene, draws) * ratio**2 * np.exp(1 - ratio**2)


@form(
    Stage.MECHANICAL,
    "Cupping moves the knuckle's crest sideways under the strip, which only a half-bent strip feels (ours).",
    set_aside=True,
    touches="palm",
)
def crest_moves_sideways(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The arch times a bow over the own bend: nothing while straight or fully bent."""
    arch = scene.rotation("PALM_ARCH")[:, :, None] / 10
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    top = draws.each("power", 0.7, 1.6)
    return signal + size * _side(scene, draws) * arch * np.sin(np.pi * bend**top)


def _side(scene: Scene, draws: Draws) -> np.ndarray:
    """The thumb's side of the arch moves the other way than the little finger's."""
    return draws.sign() * np.array([-1.0 if name.startswith("T") else 1.0 for name in scene.sensors])


FORMS = (stiffening_cloth, lifts_then_draws_down, crest_moves_sideways)
