"""Saturation: at an end of its range the reading hardly changes any more."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.CONVERTER,
    "The amplified signal exceeds the converter's full scale: every larger bend gives the highest count.",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def converter_full_scale(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hard stop; size is the share of the range above it."""
    return np.minimum(signal, scene.high - size * scene.span)


@form(
    Stage.COUNTS,
    "An amplifier nears its rail, or a stretched sensor its limit: the reading levels off (ours).",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def levelling_off_bent(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A rounded knee with hardly any slope left above it; size is the share of the range above the knee."""
    width = draws.each("rounding", 0.02, 0.05) * scene.span
    over = width * np.logaddexp(0.0, (signal - (scene.high - size * scene.span)) / width)
    return signal - over


@form(
    Stage.COUNTS,
    "A loose sensor buckles when the finger is nearly straight: it starts only once it is taut (ours).",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def slack_when_straight(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The lowest share of the range gives hardly any change; size is that share."""
    left = draws.each("slope_left", 0.0, 0.01)
    width = 0.015 * scene.span
    under = width * np.logaddexp(0.0, (scene.low + size * scene.span - signal) / width)
    return signal + (1 - left) * under


FORMS = (converter_full_scale, levelling_off_bent, slack_when_straight)
