"""Sensor fault: one sensor or its wiring is broken and reads wrongly at times or all the time.

A cold solder joint sits in one of two states, a broken shield lets the mains in, and a cracked track parts
in some of the deep bends and not in others.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.CONVERTER,
    "A cold solder joint sits in one of two states and changes between them by itself (random"
    " telegraph signal).",
    only_by_name=True,
    touches="one",
)
def two_state_joint(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A fixed number of degrees is added for stretches that begin and end at random moments."""
    stays = draws.one("stays_s", 0.4, 2.5), draws.one("shifted_s", 0.4, 2.5)
    shifted = np.empty((*signal.shape[:2], 1))
    for take, start in enumerate(scene.starts):
        random = draws.stream("states", start.key)
        pairs = round(4 * (scene.time_s[-1] - scene.time_s[0]) / sum(stays))
        lengths = random.exponential(np.tile(stays, (pairs, 1)))
        changes = scene.time_s[0] + np.cumsum(lengths.ravel())
        shifted[take, :, 0] = np.searchsorted(changes, scene.time_s) % 2
    return signal + size * draws.sign() * 2.0 * shifted


@form(
    Stage.CONVERTER,
    "A broken shield lets the mains in, which the frame rate folds down to some hertz (aliased hum).",
    only_by_name=True,
    touches="one",
)
def hum_from_mains(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A sine of the mains' frequency with a weaker third harmonic, as frames happen to meet it."""
    mains = 2 * np.pi * draws.one("mains_hz", 49.93, 50.07)
    phase = draws.one("phase", 0.0, 2 * np.pi)
    third = draws.one("third", 0.1, 0.35)
    turned = mains * scene.session_s + phase
    hum = np.sin(turned) + third * np.sin(3 * turned)
    return signal + size * 1.4 * hum[:, :, None]


@form(
    Stage.CONVERTER,
    "A cracked track parts in some of the deep bends, by another resistance each time (crack in a"
    " bent conductor).",
    only_by_name=True,
    touches="one",
)
def crack_parts_in_bends(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading leaps while the joint is bent past the crack, in about half of the bends."""
    parts_at = draws.each("parts_at", 0.4, 0.55)
    apart = (scene.own - scene.low) / scene.span > parts_at
    bends = np.cumsum(np.diff(apart, axis=1, prepend=False) & apart, axis=1)
    leaps = np.zeros_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("bends", start.key)
        heights = random.uniform(0.4, 1.6, (bends[take].max() + 1, signal.shape[2]))
        heights *= random.random(heights.shape) < 0.5
        leaps[take] = np.take_along_axis(heights, bends[take], axis=0)
    return signal + size * draws.sign() * 3.0 * np.where(apart, leaps, 0.0)


FORMS = (two_state_joint, hum_from_mains, crack_parts_in_bends)
