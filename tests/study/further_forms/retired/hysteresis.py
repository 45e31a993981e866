"""Hysteresis: the reading depends on the way the joint came to its angle, at whatever speed.

Every state here moves with the degrees travelled and never with the clock: a joint that rests changes
nothing, and the same path run through twice as fast leaves the same loop.

No form here knows the time: each state moves only when the joint moves, by how far it moves.

The cloth has a nap, a fold that tips over, or a pocket that is wide in mid-range only.
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


@form(
    Stage.MECHANICAL,
    "Cloth with a nap slides freely one way and is held against it the other way"
    " (velvet, fish scales; ours).",
    only_by_name=True,
)
def against_the_nap(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A pull builds up along the way against the nap and is let go soon on the way with it."""
    build, let_go = draws.each("build_deg", 12.0, 30.0), draws.each("let_go_deg", 2.0, 5.0)
    against = draws.sign("against")
    pull = np.zeros_like(signal[:, 0])
    out = np.zeros_like(signal)
    for frame in range(1, signal.shape[1]):
        moved = against * (signal[:, frame] - signal[:, frame - 1])
        held = 1 - (1 - pull) * np.exp(-np.maximum(moved, 0.0) / build)
        pull = held * np.exp(-np.maximum(-moved, 0.0) / let_go)
        out[:, frame] = pull
    return signal - size * 3 * against * out


@form(
    Stage.MECHANICAL,
    "A fold under the strip tips over to the side the finger last moved to, and lifts it there (ours).",
    only_by_name=True,
)
def fold_tips_over(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A lift in mid-range, up after closing and down after opening, turns over once the joint has turned."""
    slack = draws.each("tips_after_deg", 1.5, 5.0)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    lift = np.sin(np.pi * bend ** draws.each("skew", 0.7, 1.4))
    edge, side = signal[:, 0], np.ones_like(signal[:, 0])
    out = np.empty_like(signal)
    for frame in range(signal.shape[1]):
        now = signal[:, frame]
        side = np.where(now - edge > slack, 1.0, np.where(edge - now > slack, -1.0, side))
        edge = np.clip(edge, now - slack, now + slack)
        out[:, frame] = side
    return signal + size * 2 * draws.signs() * lift * out


@form(
    Stage.MECHANICAL,
    "A pocket leaves slack in mid-range and none at both ends (generalised play; Visintin 1994).",
    only_by_name=True,
)
def pocket_wide_in_middle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A place in the pocket is dragged between two curves of the bend that meet at both ends."""
    wide, middle = draws.each("width", 0.15, 0.3), draws.each("skew", 0.6, 1.6)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    half = wide * np.sin(np.pi * bend**middle)
    place = bend[:, 0]
    out = np.empty_like(signal)
    for frame in range(signal.shape[1]):
        place = np.clip(place, bend[:, frame] - half[:, frame], bend[:, frame] + half[:, frame])
        out[:, frame] = place
    return signal + size * 8 * (out - bend)


FORMS = (
    superelastic_flag,
    sticks_then_jumps,
    creases_rubbed_out,
    deepest_bend,
    sticks_and_jumps,
    butterfly,
    against_the_nap,
    fold_tips_over,
    pocket_wide_in_middle,
)
