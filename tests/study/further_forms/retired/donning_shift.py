"""Donning shift: the glove sits otherwise each time it is put on, and stays so until it is taken off.

What is drawn here is drawn once a wearing: how far the sensors are rolled round their fingers, where a fold
of cloth is caught, and how much cloth is bunched in the palm.

A wrinkle is caught under a sensor, a finger's sheath is pulled along, or cloth is stretched before it bends.

A strap with holes, cloth that stretches with each donning, or loops that guide the strip.
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


@form(
    Stage.WEARING,
    "A strap with five holes is closed in another one each time, and takes all sensors along (ours).",
    only_by_name=True,
)
def holes_of_strap(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All sensors are shifted by the same number of notches per wearing, each by a notch of its own."""
    holes = draws.stream("holes").permutation(np.linspace(-1.0, 1.0, 5))
    used = np.array([holes[start.wearing % 5] for start in scene.starts])
    notch = draws.each("notch", 0.7, 1.4) * draws.signs()
    return signal + size * 1.5 * used[:, None, None] * notch


@form(
    Stage.WEARING,
    "Cloth gives a little with each donning and never takes it back: bends count ever less (ours).",
    only_by_name=True,
)
def wider_each_time(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor falls short by a part that grows from wearing to wearing and levels off."""
    wearings = draws.one("wearings", 1.0, 3.0)
    own, gain = draws.each("own", 0.7, 1.3), draws.each("gain", 0.3, 0.9)
    donned = np.array([start.wearing for start in scene.starts])
    wide = 1 - np.exp(-donned / wearings)
    bend = _bend_again(signal, scene)
    return signal - size * 4 * own * wide[:, None, None] * (1 - gain + gain * bend)


@form(
    Stage.WEARING,
    "The strip runs through loops of thread that sit elsewhere along it in every wearing (ours).",
    only_by_name=True,
)
def loops_of_thread(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A ripple over the bend, the place of which is another in every wearing."""
    loops = draws.each("loops", 1.0, 2.2)
    phase = [draws.stream("place", start.wearing).uniform(0, 1, signal.shape[2]) for start in scene.starts]
    bend = _bend_again(signal, scene)
    return signal + size * 1.5 * np.sin(2 * np.pi * (loops * bend + np.stack(phase)[:, None]))


def _bend_again(signal: np.ndarray, scene: Scene) -> np.ndarray:
    """Each sensor's bend as a share of its range."""
    return (signal - scene.low) / scene.span


FORMS = (
    rolled_round_finger,
    caught_fold,
    bunched_in_palm,
    caught_wrinkle,
    sheath_moved,
    stretched_beforehand,
    holes_of_strap,
    wider_each_time,
    loops_of_thread,
)
