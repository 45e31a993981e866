"""Creep: a bend that is held changes the reading over seconds to a minute.

Only large strains creep, two layers creep against each other, or the give comes in jerks.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Creep grows far more than in proportion with the strain (stress-dependent compliance; Schapery 1969).",
    set_aside=True,
)
def deep_bends_creep(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A relaxation of a high power of the bend: little after small bends, much after deep ones."""
    seconds, power = draws.each("seconds", 6.0, 25.0), draws.each("power", 2.5, 4.0)
    bend = np.maximum(_bend(signal, scene), 0.0)
    return signal + size * 6 * draws.sign() * _follow(bend**power, seconds, scene.rate_hz)


@form(
    Stage.MECHANICAL,
    "A step rises for seconds and vanishes within a minute, as two layers give unequally fast (Kovacs 1963).",
    set_aside=True,
)
def two_layers_cancel(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A quick layer's relaxation less a slow one's, so that a held bend is right at once and at last."""
    quick, slow = draws.each("quick_s", 1.5, 4.0), draws.each("slow_s", 12.0, 30.0)
    bend = _bend(signal, scene)
    hump = _follow(bend, quick, scene.rate_hz) - _follow(bend, slow, scene.rate_hz)
    return signal + size * 6 * draws.signs() * hump


@form(
    Stage.MECHANICAL,
    "Fibres slip past each other in small jerks while they relax (crackling of crumpled sheets).",
    set_aside=True,
)
def gives_in_jerks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A relaxation that rests until its pent-up part lets go, which it then does at once."""
    seconds, jerk = draws.each("seconds", 6.0, 20.0), draws.each("jerk", 0.06, 0.15)
    smooth = _follow(_bend(signal, scene), seconds, scene.rate_hz)
    out = np.empty_like(signal)
    state = smooth[:, 0]
    for frame in range(signal.shape[1]):
        state = np.where(np.abs(smooth[:, frame] - state) > jerk, smooth[:, frame], state)
        out[:, frame] = state
    return signal + size * 6 * draws.sign() * out


def _bend(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return np.clip((signal - scene.low) / scene.span, -0.2, 1.2)


def _follow(drive: np.ndarray, seconds: np.ndarray, rate_hz: float) -> np.ndarray:
    """A state that closes in on the drive with one time per sensor."""
    share = 1 - np.exp(-1 / (seconds * rate_hz))
    out = np.empty_like(drive)
    state = drive[:, 0]
    for frame in range(drive.shape[1]):
        state = state + share * (drive[:, frame] - state)
        out[:, frame] = state
    return out


FORMS = (deep_bends_creep, two_layers_cancel, gives_in_jerks)
