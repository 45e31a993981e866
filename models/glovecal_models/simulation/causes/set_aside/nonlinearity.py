"""Set-aside forms of a sensor whose reading is a curved function of its own joint's angle."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Exponential in the bend (macrobend loss of optical fibre; tunnelling resistance of strain sensors).",
    set_aside=True,
    judged_by="straight_line",
)
def exponential_rise(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor answers little at first and ever more towards one end of its range."""
    steep = draws.each("steepness", 1.5, 3.5)
    from_high = draws.signs("steep_end") > 0
    bend = np.clip((signal - scene.low) / scene.span, -0.3, 1.3)
    along = np.where(from_high, bend, 1 - bend)
    rise = np.expm1(steep * along) / np.expm1(steep)
    return signal + size * 5 * draws.signs() * (rise - along)


@form(
    Stage.ELECTRICAL,
    "The logarithm of a signal with an offset (logarithmic amplifier behind a photodiode).",
    set_aside=True,
    judged_by="straight_line",
)
def log_amplifier(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor answers in proportion to the logarithm of its bend above a small threshold."""
    ratio = draws.each("ratio", 3.0, 20.0)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.3)
    return signal + size * 6 * (np.log1p(ratio * bend) / np.log1p(ratio) - bend)


@form(
    Stage.ELECTRICAL,
    "A hump at one place of the range, where a seam or fold passes over the knuckle (ours).",
    set_aside=True,
    judged_by="straight_line",
)
def seam_hump(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is right at both ends and off by a bell curve around one angle of its range."""
    place = draws.each("place", 0.3, 0.7)
    width = draws.each("width", 0.08, 0.2)
    bend = (signal - scene.low) / scene.span
    return signal + size * 2 * draws.signs() * np.exp(-0.5 * ((bend - place) / width) ** 2)


FORMS = (exponential_rise, log_amplifier, seam_hump)
