"""Hysteresis: the reading depends on the path by which the angle was reached, however fast."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _play(share: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """What is dragged along with ``share`` (T, N, S) with free travel ``radius`` (S,) to both sides."""
    dragged = np.empty_like(share)
    now = share[:, 0]
    for frame in range(share.shape[1]):
        now = np.clip(now, share[:, frame] - radius, share[:, frame] + radius)
        dragged[:, frame] = now
    return dragged


@form(
    Stage.MECHANICAL,
    "The sensor has free travel in its pocket and follows once that is used up (play operator, backlash).",
    only_by_name=True,
)
def loose_pocket_backlash(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One play of a width of its own for each sensor."""
    share = (signal - scene.low) / scene.span
    radius = draws.each("radius", 0.03, 0.08)
    return signal + size * (_play(share, radius) - share) / radius


@form(
    Stage.MECHANICAL,
    "Friction of the sleeve on the sensor that builds up over a short way after each turn (Dahl 1968).",
    only_by_name=True,
)
def sleeve_friction(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Friction goes towards -1 or 1, in the direction of the motion, exponentially along the way."""
    way = np.zeros_like(signal)
    way[:, 1:] = np.diff(signal, axis=1) / scene.span
    forget = np.exp(-np.abs(way) / draws.each("way", 0.04, 0.15))
    towards = np.sign(way) * (1 - forget)
    friction = np.zeros_like(signal)
    now = np.zeros_like(signal[:, 0])
    for frame in range(signal.shape[1]):
        now = forget[:, frame] * now + towards[:, frame]
        friction[:, frame] = now
    return signal - size * friction


@form(
    Stage.MECHANICAL,
    "Rubbing yarns of a knit: many plays in parallel, loops grow with the move (Prandtl-Ishlinskii).",
    only_by_name=True,
)
def rubbing_yarns(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Plays of many widths, the narrow ones weighing more or less for each sensor."""
    share = (signal - scene.low) / scene.span
    widest, fall = draws.each("widest", 0.25, 0.45), draws.each("fall", 0.0, 1.5)
    lagging, total = np.zeros_like(share), np.zeros_like(widest)
    for part in (np.arange(8) + 0.5) / 8:
        weight = np.exp(-fall * part)
        lagging += weight * (_play(share, widest * part) - share)
        total += weight
    return signal + size * lagging / total


FORMS = (loose_pocket_backlash, sleeve_friction, rubbing_yarns)
