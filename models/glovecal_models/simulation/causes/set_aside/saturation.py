"""Saturation: in part of the range, readings no longer tell angles apart.

Steps may grow with the signal, the window may follow the mean, or the current may be shared.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.CONVERTER,
    "Codes of companded samples lie ever further apart towards the high end (mu-law; ITU-T G.711).",
    set_aside=True,
    touches="two",
    sizes=(0.02, 1.6),
    judged_by="lost_angle",
)
def companded_codes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings stop at a few levels, which lie close together when straight and far apart when bent."""
    ratio = draws.each("ratio", 4.0, 15.0)
    bend = np.clip((signal - scene.low) / scene.span, -0.05, 1.2)
    level = np.log1p(ratio * np.maximum(bend, 0.0)) / np.log1p(ratio)
    step = np.maximum(0.4 * size, 1e-6)
    coarse = np.expm1(np.log1p(ratio) * step * np.round(level / step)) / ratio
    stepped = signal + scene.span * (coarse - bend)
    return np.where((size > 0) & (bend > 0), stepped, signal)


@form(
    Stage.COUNTS,
    "A coupling capacitor sets the middle of the input window to the signal's mean of late (AC coupling).",
    set_aside=True,
    touches="two",
    sizes=(0.02, 1.6),
    judged_by="lost_angle",
)
def window_follows_mean(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings stop on both sides of a mean that follows the signal over seconds."""
    seconds = draws.each("seconds", 5.0, 20.0)
    share = 1 - np.exp(-1 / (seconds * scene.rate_hz))
    half = scene.span * np.exp(-1.3 * size)
    out = np.empty_like(signal)
    mean = signal[:, 0]
    for frame in range(signal.shape[1]):
        mean = mean + share * (signal[:, frame] - mean)
        out[:, frame] = np.clip(signal[:, frame], mean - half, mean + half)
    return np.where(size > 0, out, signal)


@form(
    Stage.COUNTS,
    "Sensors share a supply with a current limit, so that others leave less for a bent one (ours).",
    set_aside=True,
    touches="two",
    sizes=(0.02, 1.6),
    judged_by="lost_angle",
)
def shared_current_limit(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Readings stop at a ceiling that comes down as the other joints bend."""
    taken = draws.each("taken", 0.5, 0.8)
    bend = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    others = (bend.sum(axis=2, keepdims=True) - bend) / max(bend.shape[2] - 1, 1)
    ceiling = scene.low + scene.span * (1.05 - size * (1 - taken + taken * others))
    return np.where(size > 0, np.minimum(signal, ceiling), signal)


FORMS = (companded_codes, window_follows_mean, shared_current_limit)
