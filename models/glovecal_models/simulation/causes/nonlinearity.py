"""Nonlinearity: a sensor's answer to its own joint is no straight line.

Its strength is what a straight line of the own angle leaves. Every form keeps the range's ends in place.
The four shapes are ours; that of a voltage divider follows from its circuit.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage
from glovecal_models.simulation.scene import Scene


def sine_bow(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A bow over the range, up or down."""
    return signal + size * draws.signs() * np.sin(np.pi * _bent(signal, scene))


def kink(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Another slope from a certain bend on."""
    at = draws.each("at", 0.3, 0.6)
    bent = _bent(signal, scene)
    return signal + size * draws.signs() * (np.maximum(bent - at, 0.0) - (1 - at) * bent)


def s_shape(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Steep in the middle and flat at both ends."""
    middle, width = draws.each("middle", 0.4, 0.6), draws.each("width", 0.12, 0.22)
    bent = _bent(signal, scene)
    low, high = np.tanh(-middle / width), np.tanh((1 - middle) / width)
    return signal + size * (np.tanh((bent - middle) / width) - low - (high - low) * bent)


def divider(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A resistor that grows with the bend in a divider: a hyperbola, steep at first."""
    bent = np.maximum(_bent(signal, scene), -0.1)
    fixed = draws.each("fixed_share", 0.15, 0.4)
    return signal + size * (bent / (bent + fixed) - bent / (1 + fixed))


def _bent(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return np.clip((signal - scene.low) / scene.span, -0.3, 1.3)


FORMS = (
    Form(
        "sine_bow",
        "A bow over the range (ours).",
        sine_bow,
        Stage.ELECTRICAL,
        judged_by="straight_line",
    ),
    Form(
        "kink",
        "Two straight parts with a corner, as of cloth that tightens (ours).",
        kink,
        Stage.ELECTRICAL,
        judged_by="straight_line",
    ),
    Form(
        "s_shape",
        "Steep in the middle, flat at both ends, as of a sensor longer than its joint (ours).",
        s_shape,
        Stage.ELECTRICAL,
        judged_by="straight_line",
    ),
    Form(
        "divider",
        "The hyperbola of a growing resistor in a voltage divider (circuit of home-made flex gloves).",
        divider,
        Stage.ELECTRICAL,
        set_aside=True,
        judged_by="straight_line",
    ),
)
