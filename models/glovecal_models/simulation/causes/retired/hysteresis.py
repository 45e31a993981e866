"""Hysteresis: the reading depends on the way the joint came to its angle, at whatever speed.

Every state here moves with the degrees travelled and never with the clock: a joint that rests changes
nothing, and the same path run through twice as fast leaves the same loop.

No form here knows the time: each state moves only when the joint moves, by how far it moves.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "A wire between two phases that turns at other bends closing than opening (superelastic flag of"
    " nitinol).",
    only_by_name=True,
)
def superelastic_flag(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A share of the wire is turned by closing past one ramp and turned back by opening past a lower one."""
    start = draws.each("turns_from", 0.4, 0.55)
    width = draws.each("ramp", 0.2, 0.35)
    gap = draws.each("gap", 0.15, 0.3)
    share = (scene.own - scene.low) / scene.span
    least = np.clip((share - start) / width, 0.0, 1.0)
    most = np.clip((share - start + gap) / width, 0.0, 1.0)
    turned = np.empty_like(signal)
    state = least[:, 0]
    for frame in range(signal.shape[1]):
        state = np.minimum(np.maximum(state, least[:, frame]), most[:, frame])
        turned[:, frame] = state
    return signal + size * draws.sign() * 8.0 * (turned - 0.5)


@form(
    Stage.MECHANICAL,
    "Cloth sticks, then jumps past the point where it would rest (static above kinetic friction; ours).",
    only_by_name=True,
)
def sticks_then_jumps(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The cloth stays where it is until it is left behind too far, and leaps to a smaller distance."""
    holds = draws.each("holds_deg", 10.0, 18.0)
    remains = holds * draws.each("remains_share", 0.1, 0.4)
    behind = np.empty_like(signal)
    cloth = scene.own[:, 0].copy()
    for frame in range(signal.shape[1]):
        apart = scene.own[:, frame] - cloth
        cloth = np.where(np.abs(apart) > holds, scene.own[:, frame] - np.sign(apart) * remains, cloth)
        behind[:, frame] = cloth - scene.own[:, frame]
    return signal + size * 0.4 * behind


@form(
    Stage.MECHANICAL,
    "Creases at the furthest bends reached, which the path travelled since rubs out (fading extremes; ours).",
    only_by_name=True,
)
def creases_rubbed_out(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading is drawn to the middle between the last highest and lowest bend, forgotten by path."""
    share = (scene.own - scene.low) / scene.span
    path = np.abs(np.diff(share, axis=1, prepend=share[:, :1]))
    keep = np.exp(-path / draws.each("path_in_ranges", 0.5, 1.2))
    middle = np.empty_like(signal)
    highest = lowest = share[:, 0]
    for frame in range(signal.shape[1]):
        now, kept = share[:, frame], keep[:, frame]
        highest = now + kept * np.maximum(highest - now, 0.0)
        lowest = now - kept * np.maximum(now - lowest, 0.0)
        middle[:, frame] = 0.5 * (highest + lowest) - now
    return signal + size * draws.sign() * 10.0 * middle


@form(
    Stage.MECHANICAL,
    "The deepest bend since is remembered and fades only along the way back (softening; Mullins 1969).",
    only_by_name=True,
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
    only_by_name=True,
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
    only_by_name=True,
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


FORMS = (superelastic_flag, sticks_then_jumps, creases_rubbed_out, deepest_bend, sticks_and_jumps, butterfly)
