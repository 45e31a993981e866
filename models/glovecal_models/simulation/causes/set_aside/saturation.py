"""Set-aside forms of a sensor whose readings no longer tell some angles apart."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.COUNTS,
    "Each degree takes a share of the light or charge that is left, until none is left (Beer-Lambert).",
    set_aside=True,
    judged_by="lost_angle",
    touches="two",
    sizes=(0.02, 1.6),
)
def used_up(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading approaches its end exponentially from the first degree on, sooner for a greater size."""
    share = np.maximum(size, 1e-9) * draws.each("share", 3.5, 5.0)
    bend = (signal - scene.low) / scene.span
    taken = -np.expm1(-share * np.maximum(bend, 0.0)) / share + np.minimum(bend, 0.0)
    return np.where(size > 0, scene.low + scene.span * taken, signal)


@form(
    Stage.CONVERTER,
    "Readings stop at both ends (a converter whose input window is narrower than the signal).",
    set_aside=True,
    judged_by="lost_angle",
    touches="two",
    sizes=(0.02, 1.6),
)
def narrow_window(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A part of the range is cut off at the lower and another at the upper end."""
    from_low = scene.low + size * draws.each("at_low", 0.2, 0.3) * scene.span
    from_high = scene.high - size * draws.each("at_high", 0.2, 0.3) * scene.span
    return np.where(size > 0, np.clip(signal, from_low, from_high), signal)


@form(
    Stage.CONVERTER,
    "Readings stop at the high end and come off it late (overload recovery of an amplifier).",
    set_aside=True,
    judged_by="lost_angle",
    touches="two",
    sizes=(0.02, 1.6),
)
def overload_recovery(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Above a ceiling readings stand still; afterwards they return to the joint within tenths of a second."""
    recovers_s = draws.each("recovers_s", 0.05, 0.2)
    ceiling = scene.high - 0.6 * size * scene.span
    frames = np.arange(signal.shape[1])[:, None]
    last = np.maximum.accumulate(np.where(signal >= ceiling, frames, -(10**6)), axis=1)
    held = np.exp(-(frames - last) / (recovers_s * scene.rate_hz))
    return np.where(size > 0, signal + held * (ceiling - signal), signal)


FORMS = (used_up, narrow_window, overload_recovery)
