"""Lag: each sensor comes after its joint by a short memory of its own, fractions of a second.

The memory may be a limit to the speed, unequal for rise and fall, or the flow through a hole.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "An amplifier that cannot change faster than its slew rate (operational amplifiers with small currents).",
    set_aside=True,
    sizes=(0.002, 0.8),
)
def slew_rate(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The output runs after the input at no more than a highest speed."""
    step = 0.3 * scene.span * draws.each("speed", 0.8, 1.3) / size / scene.rate_hz
    out = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        state = state + np.clip(signal[:, frame] - state, -step, step)
        out[:, frame] = state
    return out


@form(
    Stage.ELECTRICAL,
    "Rises quickly and falls slowly, or the other way (peak detector: diode, capacitor, resistor).",
    set_aside=True,
    sizes=(0.002, 0.8),
)
def peak_detector(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A first-order lag with one time while rising and several times that while falling."""
    ratio = draws.each("ratio", 3.0, 6.0)
    upward = draws.sign() > 0
    slow, fast = 1 - np.exp(-1 / (size * scene.rate_hz)), 1 - np.exp(-ratio / (size * scene.rate_hz))
    rise, fall = (fast, slow) if upward else (slow, fast)
    out = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        away = signal[:, frame] - state
        state = state + np.where(away > 0, rise, fall) * away
        out[:, frame] = state
    return out


@form(
    Stage.ELECTRICAL,
    "Fluid in a bent tube passes an orifice at a speed with the root of the pressure (Torricelli 1643).",
    set_aside=True,
    sizes=(0.002, 0.8),
)
def orifice(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading closes in with the root of what is missing, and so arrives in a finite time."""
    per_frame = np.sqrt(0.25 * scene.span * draws.each("bore", 0.7, 1.4)) / size / scene.rate_hz
    out = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        away = signal[:, frame] - state
        missing = np.abs(away)
        state = state + np.sign(away) * np.minimum(missing, per_frame * np.sqrt(missing))
        out[:, frame] = state
    return out


FORMS = (slew_rate, peak_detector, orifice)
