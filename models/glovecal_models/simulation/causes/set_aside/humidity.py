"""Humidity: readings follow the humidity of the air.

Salt on the contacts may turn into brine, damp cloth may drag, or water may detune a coil.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Salt of sweat turns to brine at one humidity and dries again at a lower one (deliquescence).",
    set_aside=True,
)
def salt_turns_to_brine(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Brine leaks beside the sensor from one humidity on until another one, more so when it is bent."""
    middle = scene.usual_air[1] + draws.one("from_usual", -0.5, 0.5)
    half, gain = draws.one("half_gap", 0.2, 0.7), draws.each("gain", 0.2, 0.8)
    air = scene.humidity_pct
    state = np.where(air[:, 0] > middle, 1.0, 0.0)
    brine = np.empty_like(air)
    for frame in range(air.shape[1]):
        now = air[:, frame]
        state = np.where(now > middle + half, 1.0, np.where(now < middle - half, 0.0, state))
        brine[:, frame] = state
    bend = (signal - scene.low) / scene.span
    return signal - size * 2 * brine[:, :, None] * (1 - gain + gain * bend)


@form(
    Stage.ELECTRICAL,
    "Damp cloth clings to the skin, and the strip lags behind both ways (skin friction; Derler & Gerhardt 2012).",
    set_aside=True,
)
def damp_cloth_clings(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A slack that has to be taken up counts in damp air and not in dry air."""
    slack, width = draws.each("slack_deg", 4.0, 9.0), draws.one("width", 0.8, 2.0)
    damp = (1 + np.tanh((scene.humidity_pct - scene.usual_air[1]) / width))[:, :, None] / 2
    out = np.empty_like(signal)
    place = signal[:, 0]
    for frame in range(signal.shape[1]):
        place = np.clip(place, signal[:, frame] - slack, signal[:, frame] + slack)
        out[:, frame] = place
    return signal + size * 0.5 * damp * (out - signal)


@form(
    Stage.ELECTRICAL,
    "Water in the cloth detunes a coil and its capacitor past the frequency they are read at (resonance curve).",
    set_aside=True,
)
def detuned_coil(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points rise to a peak at one humidity and fall off on both sides of it."""
    at = scene.usual_air[1] + draws.each("from_usual", -1.5, 1.5)
    width = draws.each("width", 0.6, 1.8)
    away = (scene.humidity_pct[:, :, None] - at) / width
    return signal + size * 3 * draws.signs() / (1 + away**2)


FORMS = (salt_turns_to_brine, damp_cloth_clings, detuned_coil)
