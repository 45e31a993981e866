"""Saturation: a magnetic core, a range learned too short, and a weak signal before a square-law detector."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.COUNTS,
    "A soft-iron core saturates as the magnet comes near at high bends (function of Langevin 1905).",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def core_saturates(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The middle of the curve moves down the range with size; below it the core answers evenly."""
    sharp = draws.one("sharp", 8.0, 14.0)
    share = np.clip((signal - scene.low) / scene.span, -0.3, 1.3)
    near = np.maximum(size, 1e-3) * sharp * np.maximum(share, 1e-4)
    kept = 3 * (1 / np.tanh(near) - 1 / near) / near
    return scene.low + scene.span * np.where(share > 1e-4, share * kept, share)


@form(
    Stage.CONVERTER,
    "Readings are cut at the range learned on putting on, which each wearing learns anew (ours).",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def cut_at_learned_range(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The hand was not quite closed, and not quite open, while it was learned."""
    parts = [
        draws.stream("parts", start.wearing).uniform(0.1, 0.9, signal.shape[2]) for start in scene.starts
    ]
    below = np.minimum(size, 0.98) * np.stack(parts)[:, None]
    above = 1 - np.minimum(size, 0.98) + below
    return scene.low + scene.span * np.clip((signal - scene.low) / scene.span, below, above)


@form(
    Stage.COUNTS,
    "A diode detector answers weak signals by their square, so straight joints look alike (square law).",
    only_by_name=True,
    touches="two",
    judged_by="lost_angle",
    sizes=(0.02, 1.6),
)
def weak_signals_by_square(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A parabola up to the share of the range that size tells, then straight on."""
    toe = np.maximum(size, 1e-3)
    share = np.maximum((signal - scene.low) / scene.span, 0.0)
    reads = np.where(share < toe, share**2 / (2 * toe), share - toe / 2)
    return scene.low + scene.span * reads


FORMS = (core_saturates, cut_at_learned_range, weak_signals_by_square)
