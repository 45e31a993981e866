"""Hysteresis: a magnetic film, a strip that rests between ribs, and a sleeve that tightens with the fist."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "A weak magnet turns a film's magnetisation past its hard axis, with jumps (Stoner & Wohlfarth 1948).",
    only_by_name=True,
)
def film_hangs_on_hard_axis(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The magnetisation rests in the nearest hollow of its energy; the joint is geared up two to one."""
    field, hard = draws.each("field", 0.55, 0.68), draws.each("hard_share", 0.35, 0.65)
    middle = scene.low + hard * scene.span
    turned = np.pi / 2 + 2 * np.radians(signal - middle)
    along, lagging = turned[:, 0].copy(), np.empty_like(signal)
    for frame in range(signal.shape[1]):
        for _ in range(6):
            along -= 0.35 * (np.sin(2 * along) + 2 * field * np.sin(along - turned[:, frame]))
        lagging[:, frame] = along - turned[:, frame]
    return signal + size * 0.5 * np.degrees(lagging)


@form(
    Stage.MECHANICAL,
    "The strip's end rests between two ribs of the knit until it is pulled over (Prandtl and Tomlinson).",
    only_by_name=True,
)
def rests_between_ribs(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """It stays in its groove beyond half-way to the next, so grooves change elsewhere on the way back."""
    apart, holds = draws.each("apart_deg", 8.0, 15.0), draws.each("holds", 0.7, 1.0)
    first = draws.each("first", 0.0, 1.0)
    ribs = signal / apart + first
    groove, held = np.round(ribs[:, 0]), np.empty_like(signal)
    for frame in range(signal.shape[1]):
        groove = np.where(np.abs(ribs[:, frame] - groove) > holds, np.round(ribs[:, frame]), groove)
        held[:, frame] = groove
    return signal + size * apart * (held - ribs)


@form(
    Stage.MECHANICAL,
    "Friction of the sleeve grows with its tension, which the hand's closing makes (Amontons 1699; ours).",
    only_by_name=True,
)
def sleeve_tightens_with_fist(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A free travel that is wide in a closed hand and narrow in an open one."""
    width, tightens = draws.each("width_deg", 1.0, 3.0), draws.one("tightens", 4.0, 8.0)
    half = width * (1 + tightens * scene.closing[:, :, None])
    behind, follows = signal[:, 0], np.empty_like(signal)
    for frame in range(signal.shape[1]):
        behind = np.clip(behind, signal[:, frame] - half[:, frame], signal[:, frame] + half[:, frame])
        follows[:, frame] = behind
    return signal + size * (follows - signal)


FORMS = (film_hangs_on_hard_axis, rests_between_ribs, sleeve_tightens_with_fist)
