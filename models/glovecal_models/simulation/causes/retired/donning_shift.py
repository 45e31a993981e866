"""Donning shift: the glove sits otherwise each time it is put on, and stays so until it is taken off.

What is drawn here is drawn once a wearing: how far the sensors are rolled round their fingers, where a fold
of cloth is caught, and how much cloth is bunched in the palm.

A wrinkle is caught under a sensor, a finger's sheath is pulled along, or cloth is stretched before it bends.
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


@form(
    Stage.WEARING,
    "A wrinkle is caught somewhere along the bend, elsewhere in every wearing, and lifts the sensor (ours).",
    only_by_name=True,
)
def caught_wrinkle(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hump of a place, width and height of its own in each wearing."""
    place, width = _worn(scene, draws, "place", 0.2, 0.75), _worn(scene, draws, "width", 0.08, 0.2)
    height = _worn(scene, draws, "height", -1.5, 1.5)
    return signal + size * 2 * height * np.exp(-(((_bend(signal, scene) - place) / width) ** 2))


@form(
    Stage.WEARING,
    "A finger's sheath sits further up or down per wearing: what one joint gains the next one loses (ours).",
    only_by_name=True,
)
def sheath_moved(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One number per finger and wearing, with the other sign at every other joint of the finger."""
    fingers = [name.split("_")[0] for name in scene.sensors]
    heads = [fingers.index(finger) for finger in fingers]
    order = np.array([fingers[:place].count(finger) for place, finger in enumerate(fingers)])
    moved = _worn(scene, draws, "moved", -1.5, 1.5)[:, :, heads]
    return signal + size * 2 * np.where(order % 2 == 0, 1.0, -1.0) * draws.each("lever", 0.7, 1.3) * moved


@form(
    Stage.WEARING,
    "Cloth stretched on putting on answers with another power of the bend in each wearing (ours).",
    only_by_name=True,
)
def stretched_beforehand(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A power curve per wearing that is right at both ends of the range."""
    bend = np.clip(_bend(signal, scene), 0.0, 1.0)
    power = np.exp(_worn(scene, draws, "power", -0.7, 0.7))
    return signal + size * 10 * (bend**power - bend)


def _worn(scene: Scene, draws: Draws, name: str, low: float, high: float) -> np.ndarray:
    """A number per wearing and sensor, shape (T, 1, S)."""
    sensors = len(scene.sensors)
    drawn = [draws.stream(name, start.wearing).uniform(low, high, sensors) for start in scene.starts]
    return np.stack(drawn)[:, None, :]


def _bend(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return (signal - scene.low) / scene.span


FORMS = (
    rolled_round_finger,
    caught_fold,
    bunched_in_palm,
    caught_wrinkle,
    sheath_moved,
    stretched_beforehand,
)
