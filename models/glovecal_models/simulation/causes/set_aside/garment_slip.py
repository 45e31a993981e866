"""Set-aside forms of a glove that moves on the hand while it is worn and is not brought back."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

MOVES = 1000


@form(
    Stage.WEARING,
    "The glove works along the hand with every closing: a shift by the fingers' path so far (ours).",
    set_aside=True,
)
def works_along_with_use(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The shift goes with all closing and opening of the hand so far, with little of it between takes."""
    per_s = draws.one("closings_per_s_between_takes", 0.02, 0.05)
    weight = draws.each("weight", 0.5, 1.5) * draws.signs()
    ease = np.array([[draws.stream("ease", start.wearing).uniform(0.6, 1.6)] for start in scene.starts])
    before = per_s * np.maximum(scene.since_donned_s[:, :1], 0.0)
    travelled = np.cumsum(np.abs(np.diff(scene.closing, axis=1, prepend=scene.closing[:, :1])), axis=1)
    return signal + size * weight * (ease * (before + travelled) / 10)[..., None]


@form(
    Stage.WEARING,
    "Tugs at cable or cuff at random moments shift all sensors at once and stay (compound Poisson; ours).",
    set_aside=True,
)
def tugs(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Steps of Laplace-distributed height at moments without memory, added up since donning."""
    every_s = draws.one("every_s", 12.0, 35.0)
    shift = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("tugs", start.wearing)
        moments = np.cumsum(random.exponential(every_s, MOVES))
        heights = random.laplace(size=(MOVES, signal.shape[-1]))
        added = np.concatenate([np.zeros((1, signal.shape[-1])), np.cumsum(heights, axis=0)])
        shift[take] = added[np.searchsorted(moments, scene.since_donned_s[take])]
    return signal + size * shift


@form(
    Stage.WEARING,
    "Cloth slides along the finger at one steady speed, then another, and bends count more or less (ours).",
    set_aside=True,
)
def slides_along_finger(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A path of straight pieces since donning, times the bend."""
    lasts_s = draws.one("lasts_s", 15.0, 40.0)
    straight = draws.each("straight", 0.0, 0.4)
    path = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("sliding", start.wearing)
        turns = np.concatenate([[0.0], np.cumsum(random.exponential(lasts_s, MOVES))])
        speeds = random.standard_normal((MOVES, signal.shape[-1])) / lasts_s
        places = np.cumsum(speeds * np.diff(turns)[:, None], axis=0)
        for sensor in range(signal.shape[-1]):
            known = np.concatenate([[0.0], places[:, sensor]])
            path[take, :, sensor] = np.interp(scene.since_donned_s[take], turns, known)
    bend = (signal - scene.low) / scene.span
    return signal + size * 2 * path * (straight + bend)


FORMS = (works_along_with_use, tugs, slides_along_finger)
