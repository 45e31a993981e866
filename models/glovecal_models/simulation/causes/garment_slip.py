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


FORMS = (random_walk, steps_when_fast, to_one_side)
