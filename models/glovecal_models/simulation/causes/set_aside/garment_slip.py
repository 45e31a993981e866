"""Garment slip: how the glove sits changes within a wearing and is not brought back before it is taken off.

A strap lets go, a wrinkle travels along the finger, and every fist pulls the glove on by another notch.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.WEARING,
    "Once in each wearing a strap lets go, and the glove sits elsewhere from then on (ours).",
    set_aside=True,
)
def strap_lets_go(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One slip per wearing, during one of its takes, of a size and direction of its own per sensor."""
    slipped = np.empty((len(scene.starts), len(scene.time_s), len(scene.sensors)))
    for row, start in enumerate(scene.starts):
        random = draws.stream("slip", start.wearing)
        takes = [other for other in scene.starts if other.wearing == start.wearing]
        during = takes[int(random.random() * len(takes))]
        moment_s = during.since_donned_s + random.uniform(0.15, 0.85) * during.take_s
        far = random.choice([-1.0, 1.0], len(scene.sensors)) * random.uniform(0.6, 1.4, len(scene.sensors))
        after = np.clip((scene.since_donned_s[row] - moment_s) / random.uniform(0.2, 1.0), -30, 30)
        slipped[row] = far / (1 + np.exp(-after[:, None]))
    return signal + size * 2 * slipped


@form(
    Stage.WEARING,
    "A wrinkle travels along the finger from donning on, and lifts the sensor at ever larger bends (ours).",
    set_aside=True,
)
def wrinkle_travels(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hump over the bend whose place moves on with the time since donning, ever more slowly."""
    since = np.maximum(scene.since_donned_s, 0)[:, :, None]
    moved = draws.each("way", 0.4, 0.7) * -np.expm1(-since / draws.each("slows_s", 60.0, 200.0))
    place = draws.each("first", 0.1, 0.25) + moved
    bend = (signal - scene.low) / scene.span
    hump = np.exp(-(((bend - place) / draws.each("width", 0.12, 0.2)) ** 2))
    return signal + size * draws.signs() * 3 * hump


@form(
    Stage.WEARING,
    "Every fist pulls the glove on by a notch that is not given back, the first ones most (ratchet; ours).",
    set_aside=True,
)
def notch_by_fist(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A power of the number of fists made since donning."""
    made = _fists(scene, draws.one("closed", 0.52, 0.6), draws.one("opened", 0.4, 0.46))
    return signal + size * draws.signs() * made[:, :, None] ** draws.each("power", 0.5, 0.9)


def _fists(scene: Scene, closed: float, opened: float) -> np.ndarray:
    """How often the hand has closed since donning, shape (T, N); a fist counts once until reopened."""
    shut = np.zeros(len(scene.starts), dtype=bool)
    made = np.zeros(scene.closing.shape)
    for frame in range(1, made.shape[1]):
        now = scene.closing[:, frame]
        begins = ~shut & (now > closed)
        shut = (shut | begins) & (now > opened)
        made[:, frame] = made[:, frame - 1] + begins
    last = made[:, scene.recorded.stop - 1].copy()
    for row, start in enumerate(scene.starts):
        for earlier, other in enumerate(scene.starts):
            if other.wearing == start.wearing and other.session_s < start.session_s:
                made[row] += last[earlier]
    return made


FORMS = (strap_lets_go, wrinkle_travels, notch_by_fist)
