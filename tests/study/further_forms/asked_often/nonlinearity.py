"""Nonlinearity: the reading is a curved function of the sensor's own angle, always the same."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _share(signal: np.ndarray, scene: Scene) -> np.ndarray:
    """The sensor's angle as a share of its range, a little beyond both ends at most."""
    return np.clip((signal - scene.low) / scene.span, -0.3, 1.3)


@form(
    Stage.ELECTRICAL,
    "Resistance of a carbon-ink bend sensor that grows ever faster with bending, exponentially (ours).",
    only_by_name=True,
    judged_by="straight_line",
)
def ink_resistance_growth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """An exponential through both ends of the range, less the straight line."""
    rate = draws.each("growth", 1.0, 2.5)
    share = _share(signal, scene)
    return signal + size * (np.expm1(rate * share) / np.expm1(rate) - share)


@form(
    Stage.ELECTRICAL,
    "Voltage divider: the output flattens as the sensor outgrows its resistor (Ohm's law, R / (R + R0)).",
    only_by_name=True,
    judged_by="straight_line",
)
def divider_flattening(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hyperbola through both ends of the range, less the straight line."""
    ratio = draws.each("ratio", 0.6, 2.0)
    share = _share(signal, scene)
    return signal + size * ((1 + ratio) * share / (1 + ratio * share) - share)


@form(
    Stage.ELECTRICAL,
    "S-shape: a sensor answers most where the crease of the joint lies under its middle (ours).",
    only_by_name=True,
    judged_by="straight_line",
)
def sensitive_middle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A smooth step about the steepest place, less the straight line between its ends."""
    middle = draws.each("middle", 0.4, 0.6)
    steepness = draws.each("steepness", 1.6, 2.6)
    share = _share(signal, scene)
    start, end = np.tanh(-steepness * middle), np.tanh(steepness * (1 - middle))
    return signal + size * ((np.tanh(steepness * (share - middle)) - start) / (end - start) - share)


FORMS = (ink_resistance_growth, divider_flattening, sensitive_middle)
