"""Hysteresis: the reading depends on the way the joint came, at whatever speed it came.

No form here knows the time: each state moves only when the joint moves, by how far it moves.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "The deepest bend since is remembered and fades only along the way back (softening; Mullins 1969).",
    set_aside=True,
)
def deepest_bend(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Cloth stretched by the deepest bend hangs loose until part of the way has been opened again."""
    fades = draws.each("fades", 0.25, 0.5)
    deepest = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        now = signal[:, frame]
        opened = np.maximum(signal[:, max(frame - 1, 0)] - now, 0)
        state = np.maximum(now, state - fades * opened)
        deepest[:, frame] = state
    return signal - size * 0.1 * (deepest - signal)


@form(
    Stage.MECHANICAL,
    "The strip sticks to the skin and jumps right after it once pulled far enough (stick-slip friction).",
    set_aside=True,
)
def sticks_and_jumps(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What sticks stays behind by up to a width and then leaps all the way, not only to the edge."""
    width = draws.each("width_deg", 6.0, 14.0)
    stuck = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        now = signal[:, frame]
        state = np.where(np.abs(now - state) > width, now, state)
        stuck[:, frame] = state
    return signal + size * (stuck - signal) / width


@form(
    Stage.MECHANICAL,
    "Loops that cross in mid-range, low on the way in on one side, high on the other (butterfly).",
    set_aside=True,
)
def butterfly(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The lag of a friction element times the distance from a crossing point, as of ferroelectric strain."""
    width = draws.each("width_deg", 4.0, 9.0)
    behind = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        now = signal[:, frame]
        state = np.clip(state, now - width, now + width)
        behind[:, frame] = (now - state) / width
    across = (signal - scene.low) / scene.span - draws.each("crossing", 0.38, 0.55)
    return signal + size * draws.sign() * 4 * behind * across


FORMS = (deepest_bend, sticks_and_jumps, butterfly)
