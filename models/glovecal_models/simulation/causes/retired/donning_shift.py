"""Donning shift: the glove sits otherwise each time it is put on, and stays so until it is taken off.

What is drawn here is drawn once a wearing: how far the sensors are rolled round their fingers, where a fold
of cloth is caught, and how much cloth is bunched in the palm.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.WEARING,
    "Each sensor rolled round its finger per wearing, so that it sees the cosine of that of its bend (ours).",
    only_by_name=True,
)
def rolled_round_finger(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Bends count less by a share that differs with every wearing, and nothing changes while straight."""
    roll = _per_wearing(scene, draws, "roll_share", 0.0, 1.0)
    return signal - size * 10.0 * (1 - np.cos(np.pi / 3 * roll)) * (signal - scene.low) / scene.span


@form(
    Stage.WEARING,
    "A fold of cloth is caught under each sensor at another place per wearing: a hump of its own"
    " height (ours).",
    only_by_name=True,
)
def caught_fold(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """While the knuckle passes over the fold the strip is lifted; where and how far is new every time."""
    place = _per_wearing(scene, draws, "place", 0.2, 0.8)
    height = _per_wearing(scene, draws, "height", 0.4, 1.6)
    width = draws.each("width", 0.12, 0.25)
    share = (signal - scene.low) / scene.span
    return signal + size * draws.signs() * 6.0 * height * np.exp(-0.5 * np.square((share - place) / width))


@form(
    Stage.WEARING,
    "Cloth bunched in the palm per wearing is pressed together by bent fingers only (ours).",
    only_by_name=True,
)
def bunched_in_palm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing while the finger is straight; past some bend a push that differs with every wearing."""
    amount = _per_wearing(scene, draws, "amount", 0.0, 2.0)
    touches = draws.each("touches_at", 0.3, 0.5)
    soft = 0.05
    pressed = soft * np.logaddexp(0.0, ((signal - scene.low) / scene.span - touches) / soft)
    return signal - size * 10.0 * amount * pressed


def _per_wearing(scene: Scene, draws: Draws, name: str, low: float, high: float) -> np.ndarray:
    """A number per take and sensor that is the same in all takes of a wearing, shape (T, 1, S)."""
    channels = len(scene.sensors)
    drawn = [draws.stream(name, start.wearing).uniform(low, high, channels) for start in scene.starts]
    return np.stack(drawn)[:, None, :]


FORMS = (rolled_round_finger, caught_fold, bunched_in_palm)
