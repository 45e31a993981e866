"""Saturation: part of the bend no longer changes the reading, and no calibration brings it back.

Amplifiers end at their supply, resistive films flatten, a loosely fixed sensor does not bend at first (the
Ninapro DB9 page calls sensors unreliable on small hands). The shapes are ours.
Neighbours may bend a sensor beyond its own joint's range, so the size counts in ranges from
``BEYOND`` outside of it.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

SIZES = (0.02, 1.6)
BEYOND = 0.5


@form(
    Stage.CONVERTER,
    "Readings stop at one end (an amplifier at its supply).",
    judged_by="lost_angle",
    sizes=SIZES,
    touches="two",
)
def hard_clip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """An end of the converter's range is reached: readings stay at it."""
    at_high_end = draws.signs("end") > 0
    highest = np.where(at_high_end, scene.high + (BEYOND - size) * scene.span, np.inf)
    lowest = np.where(at_high_end, -np.inf, scene.low - (BEYOND - size) * scene.span)
    return np.clip(signal, lowest, highest)


@form(
    Stage.COUNTS,
    "Readings flatten towards the high end (a resistive film that is stretched out).",
    judged_by="lost_angle",
    sizes=SIZES,
    touches="two",
)
def soft_tanh(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings flatten towards the high end."""
    knee = 1 + BEYOND - size
    bent = (signal - scene.low) / scene.span
    room = draws.each("room_share", 0.03, 0.08)
    flattened = knee + room * np.tanh(np.maximum(bent - knee, 0.0) / room)
    return scene.low + scene.span * np.where(bent > knee, flattened, bent)


@form(
    Stage.COUNTS,
    "Readings begin to change only after some bend (a sensor loose in its pocket; ours).",
    judged_by="lost_angle",
    sizes=SIZES,
    touches="two",
)
def dead_zone(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing happens before the sensor touches the finger, and little at first."""
    bent = (signal - scene.low) / scene.span
    corner = draws.each("corner_share", 0.005, 0.02)
    begins = size - BEYOND
    beyond = (bent - begins) / corner
    touched = corner * (np.maximum(beyond, 0) + np.log1p(np.exp(-np.abs(beyond))))
    return scene.low + scene.span * (begins + touched)


@form(
    Stage.COUNTS,
    "Each degree takes a share of the light or charge that is left, until none is left (Beer-Lambert).",
    judged_by="lost_angle",
    touches="two",
    sizes=(0.02, 1.6),
    only_by_name=True,
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
    judged_by="lost_angle",
    touches="two",
    sizes=(0.02, 1.6),
    only_by_name=True,
)
def narrow_window(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A part of the range is cut off at the lower and another at the upper end."""
    from_low = scene.low + size * draws.each("at_low", 0.2, 0.3) * scene.span
    from_high = scene.high - size * draws.each("at_high", 0.2, 0.3) * scene.span
    return np.where(size > 0, np.clip(signal, from_low, from_high), signal)


@form(
    Stage.CONVERTER,
    "Readings stop at the high end and come off it late (overload recovery of an amplifier).",
    judged_by="lost_angle",
    touches="two",
    sizes=(0.02, 1.6),
    only_by_name=True,
)
def overload_recovery(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Above a ceiling readings stand still; afterwards they return to the joint within tenths of a second."""
    recovers_s = draws.each("recovers_s", 0.05, 0.2)
    ceiling = scene.high - 0.6 * size * scene.span
    frames = np.arange(signal.shape[1])[:, None]
    last = np.maximum.accumulate(np.where(signal >= ceiling, frames, -(10**6)), axis=1)
    held = np.exp(-(frames - last) / (recovers_s * scene.rate_hz))
    return np.where(size > 0, signal + held * (ceiling - signal), signal)


FORMS = (
    hard_clip,
    soft_tanh,
    dead_zone,
    used_up,
    narrow_window,
    overload_recovery,
)
