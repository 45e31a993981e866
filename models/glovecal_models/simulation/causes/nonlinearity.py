"""Nonlinearity: a sensor's answer to its own joint is no straight line.

Its strength is what a straight line of the own angle leaves. Every form keeps the range's ends in place.
The four shapes are ours; that of a voltage divider follows from its circuit.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(Stage.ELECTRICAL, "A bow over the range (ours).", judged_by="straight_line")
def sine_bow(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A bow over the range, up or down."""
    return signal + size * draws.signs() * np.sin(np.pi * _bent(signal, scene))


@form(
    Stage.ELECTRICAL,
    "Two straight parts with a corner, as of cloth that tightens (ours).",
    judged_by="straight_line",
)
def kink(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Another slope from a certain bend on."""
    at = draws.each("at", 0.3, 0.6)
    bent = _bent(signal, scene)
    return signal + size * draws.signs() * (np.maximum(bent - at, 0.0) - (1 - at) * bent)


@form(
    Stage.ELECTRICAL,
    "Steep in the middle, flat at both ends, as of a sensor longer than its joint (ours).",
    judged_by="straight_line",
)
def s_shape(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Steep in the middle and flat at both ends."""
    middle, width = draws.each("middle", 0.4, 0.6), draws.each("width", 0.12, 0.22)
    bent = _bent(signal, scene)
    low, high = np.tanh(-middle / width), np.tanh((1 - middle) / width)
    return signal + size * (np.tanh((bent - middle) / width) - low - (high - low) * bent)


@form(
    Stage.ELECTRICAL,
    "The hyperbola of a growing resistor in a voltage divider (circuit of home-made flex gloves).",
    judged_by="straight_line",
)
def divider(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A resistor that grows with the bend in a divider: a hyperbola, steep at first."""
    bent = np.maximum(_bent(signal, scene), -0.1)
    fixed = draws.each("fixed_share", 0.15, 0.4)
    return signal + size * (bent / (bent + fixed) - bent / (1 + fixed))


def _bent(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return np.clip((signal - scene.low) / scene.span, -0.3, 1.3)


@form(
    Stage.ELECTRICAL,
    "Exponential in the bend (macrobend loss of optical fibre; tunnelling resistance of strain sensors).",
    judged_by="straight_line",
    only_by_name=True,
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
    judged_by="straight_line",
    only_by_name=True,
)
def log_amplifier(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor answers in proportion to the logarithm of its bend above a small threshold."""
    ratio = draws.each("ratio", 3.0, 20.0)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.3)
    return signal + size * 6 * (np.log1p(ratio * bend) / np.log1p(ratio) - bend)


@form(
    Stage.ELECTRICAL,
    "A hump at one place of the range, where a seam or fold passes over the knuckle (ours).",
    judged_by="straight_line",
    only_by_name=True,
)
def seam_hump(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is right at both ends and off by a bell curve around one angle of its range."""
    place = draws.each("place", 0.3, 0.7)
    width = draws.each("width", 0.08, 0.2)
    bend = (signal - scene.low) / scene.span
    return signal + size * 2 * draws.signs() * np.exp(-0.5 * ((bend - place) / width) ** 2)


FORMS = (
    sine_bow,
    kink,
    s_shape,
    divider,
    exponential_rise,
    log_amplifier,
    seam_hump,
)
