"""Hysteresis: closing and opening give other readings at the same angle, however slow or fast.

The cloth has a nap, a fold that tips over, or a pocket that is wide in mid-range only.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Cloth with a nap slides freely one way and is held against it the other way (velvet, fish scales; ours).",
    set_aside=True,
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
    set_aside=True,
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
    set_aside=True,
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


FORMS = (against_the_nap, fold_tips_over, pocket_wide_in_middle)
