"""Lag: each sensor comes after its joint by a short memory of its own, fractions of a second.

Only a part of it may be late, a tracking filter may run past, or a photocell be sluggish in the dark.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "A part of the strip follows at once, the rest through a gel layer (spring and damper; Zener solid).",
    set_aside=True,
    sizes=(0.002, 0.8),
)
def part_in_gel(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The prompt signal and a first-order lag of it are mixed, the late part being the larger one."""
    late = draws.each("late_share", 0.6, 0.9)
    keep = np.exp(-1 / (2 * size * scene.rate_hz))
    out = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        state = signal[:, frame] + keep * (state - signal[:, frame])
        out[:, frame] = state
    return (1 - late) * signal + late * out


@form(
    Stage.ELECTRICAL,
    "Firmware tracks place and speed: right at even speed, late at every turn (alpha-beta filter).",
    set_aside=True,
    sizes=(0.002, 0.8),
)
def tracks_place_and_speed(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A critically damped alpha-beta filter (Benedict & Bordner 1962) with one memory per sensor."""
    keep = np.exp(-1 / (draws.each("memory", 0.8, 1.2) * size * scene.rate_hz))
    alpha, beta = 1 - keep**2, (1 - keep) ** 2
    out = np.empty_like(signal)
    place, speed = signal[:, 0], np.zeros_like(signal[:, 0])
    for frame in range(signal.shape[1]):
        missing = signal[:, frame] - place - speed
        place, speed = place + speed + alpha * missing, speed + beta * missing
        out[:, frame] = place
    return out


@form(
    Stage.ELECTRICAL,
    "Carriers of a photocell recombine in pairs, so that it is quick in light and slow in the dark (Rose 1963).",
    set_aside=True,
    sizes=(0.002, 0.8),
)
def photocell(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A state closes in on the light by the difference of both squares; light falls or rises with the bend."""
    dark = draws.each("dark_level", 0.15, 0.35)
    away = draws.signs("light_goes") < 0
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.1)
    light = np.sqrt(dark**2 + np.where(away, 1.1 - bend, bend + 0.1) ** 2)
    now = light[:, 0]
    late = np.empty_like(signal)
    for frame in range(signal.shape[1]):
        target = light[:, frame]
        quick = np.exp(-(target + now) / (size * scene.rate_hz))
        now = target + quick * (now - target)
        late[:, frame] = now
    seen = np.sqrt(np.maximum(late**2 - dark**2, 0.0))
    return scene.low + scene.span * np.where(away, 1.1 - seen, seen - 0.1)


FORMS = (part_in_gel, tracks_place_and_speed, photocell)
