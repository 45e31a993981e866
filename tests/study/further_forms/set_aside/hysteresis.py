"""Set-aside forms of hysteresis."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "A strip sliding in a curved sleeve is held by friction that grows exponentially with the wrapped"
    " angle (capstan equation, Euler 1769).",
    set_aside=True,
)
def capstan_sleeve(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Play whose width grows with the bend."""
    friction = draws.each("friction", 0.5, 1.2)
    width = draws.each("width_deg", 2.0, 4.0) * np.exp(friction * np.radians(np.clip(signal, -20.0, 120.0)))
    held = np.empty_like(signal)
    state = signal[:, 0].copy()
    for n in range(signal.shape[1]):
        state = np.clip(state, signal[:, n] - width[:, n], signal[:, n] + width[:, n])
        held[:, n] = state
    return signal + size * (held - signal) / 5.0


@form(
    Stage.MECHANICAL,
    "A few folds of the cloth snap over at one angle and back at another, each by itself (coarse "
    "relays after Preisach 1935).",
    set_aside=True,
)
def snapping_folds(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Four relays of different place, width and weight for each sensor."""
    bent = (signal - scene.low) / scene.span
    steps = np.zeros_like(signal)
    for fold in range(4):
        centre = draws.each(f"centre_{fold}", 0.1 + 0.15 * fold, 0.25 + 0.15 * fold)
        half = draws.each(f"half_{fold}", 0.04, 0.16)
        weight = draws.each(f"weight_{fold}", 0.5, 1.5)
        event = (bent > centre + half).astype(int) - (bent < centre - half).astype(int)
        last = np.maximum.accumulate(np.where(event != 0, np.arange(bent.shape[1])[:, None], 0), axis=1)
        state = np.take_along_axis(event, last, axis=1)
        steps += weight * np.where(state == 0, -1, state)
    return signal - size * steps


@form(
    Stage.MECHANICAL,
    "The memory of a woven strip fades with the path travelled, sooner while bending than while "
    "opening (Coleman and Hodgdon 1986).",
    set_aside=True,
)
def path_forgets(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A follower in travelled degrees instead of seconds."""
    bending, opening = draws.each("bending_deg", 6.0, 14.0), draws.each("opening_deg", 14.0, 35.0)
    followed = np.empty_like(signal)
    state = signal[:, 0].copy()
    before = signal[:, 0]
    for n in range(signal.shape[1]):
        step = signal[:, n] - before
        share = -np.expm1(-np.where(step > 0, step / bending, -step / opening))
        state += share * (signal[:, n] - state)
        followed[:, n] = state
        before = signal[:, n]
    return signal + size * (followed - signal) / 6.0


FORMS: tuple[Form, ...] = (capstan_sleeve, snapping_folds, path_forgets)
