"""Garment slip: within one wearing the glove creeps over the hand, and nothing brings it back.

Carmel et al. 2014 find 3 degrees between wearings; within one wearing Gentner & Classen 2009
find a repeatability of 1.6 degrees SD. The laws are ours.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

LONGEST_WORN_S = 7200


@form(Stage.WEARING, "Small shifts at every moment that add up (random walk; ours).")
def random_walk(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Steps to and fro at every moment: the way grows with the square root of the time worn."""
    slipped = np.empty_like(signal)
    for row, start in enumerate(scene.starts):
        steps = draws.stream("walk", start.wearing).standard_normal((LONGEST_WORN_S, len(scene.sensors)))
        way = np.cumsum(steps, axis=0)
        worn_s = np.maximum(scene.since_donned_s[row], 0.0)
        slipped[row] = np.column_stack([np.interp(worn_s, np.arange(LONGEST_WORN_S), one) for one in way.T])
    return signal + size * slipped


@form(Stage.WEARING, "Jumps when a joint moves fast, rest in between (stick and slip of cloth on skin).")
def steps_when_fast(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The cloth sticks, and jumps now and then when a joint moves fast."""
    speed = np.abs(np.diff(scene.own, axis=1, prepend=scene.own[:, :1])) * scene.rate_hz
    limit = np.maximum(np.quantile(speed, 0.93, axis=(0, 1)), 10.0)
    chance = draws.one("jumps_per_s_of_fast_moves", 1.0, 3.0) / scene.rate_hz
    slipped = np.empty_like(signal)
    for row, start in enumerate(scene.starts):
        random = draws.stream("jump", start.key)
        jumps = (speed[row] > limit) & (random.random(signal.shape[1:]) < chance)
        before = 1.5 * random.standard_normal(signal.shape[2])
        slipped[row] = before + np.cumsum(jumps * random.standard_normal(signal.shape[1:]), axis=0)
    return signal + size * slipped


@form(
    Stage.WEARING,
    "A shift that always goes one way and settles within minutes of donning (a cuff working down).",
)
def to_one_side(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The cuff works its way down the wrist: fast after donning, ever more slowly, always one way."""
    worn = np.maximum(scene.since_donned_s, 0.0)
    way = np.stack(
        [
            -np.expm1(-worn[row] / draws.stream("time", start.wearing).uniform(100.0, 400.0))
            * draws.stream("far", start.wearing).uniform(0.5, 1.5)
            for row, start in enumerate(scene.starts)
        ]
    )
    return signal + size * draws.signs() * way[:, :, None]


MOVES = 1000


@form(
    Stage.WEARING,
    "The glove works along the hand with every closing: a shift by the fingers' path so far (ours).",
    only_by_name=True,
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
    only_by_name=True,
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
    only_by_name=True,
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


FORMS = (
    random_walk,
    steps_when_fast,
    to_one_side,
    works_along_with_use,
    tugs,
    slides_along_finger,
)
