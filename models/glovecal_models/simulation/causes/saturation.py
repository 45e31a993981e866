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


FORMS = (hard_clip, soft_tanh, dead_zone)
