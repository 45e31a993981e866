"""Donning shift: the glove sits otherwise in every wearing, and stays so until it is taken off.

A strap with holes, cloth that stretches with each donning, or loops that guide the strip.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.WEARING,
    "A strap with five holes is closed in another one each time, and takes all sensors along (ours).",
    set_aside=True,
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
    set_aside=True,
)
def wider_each_time(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor falls short by a part that grows from wearing to wearing and levels off."""
    wearings = draws.one("wearings", 1.0, 3.0)
    own, gain = draws.each("own", 0.7, 1.3), draws.each("gain", 0.3, 0.9)
    donned = np.array([start.wearing for start in scene.starts])
    wide = 1 - np.exp(-donned / wearings)
    bend = _bend(signal, scene)
    return signal - size * 4 * own * wide[:, None, None] * (1 - gain + gain * bend)


@form(
    Stage.WEARING,
    "The strip runs through loops of thread that sit elsewhere along it in every wearing (ours).",
    set_aside=True,
)
def loops_of_thread(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A ripple over the bend, the place of which is another in every wearing."""
    loops = draws.each("loops", 1.0, 2.2)
    phase = [draws.stream("place", start.wearing).uniform(0, 1, signal.shape[2]) for start in scene.starts]
    bend = _bend(signal, scene)
    return signal + size * 1.5 * np.sin(2 * np.pi * (loops * bend + np.stack(phase)[:, None]))


def _bend(signal: np.ndarray, scene: Scene) -> np.ndarray:
    """Each sensor's bend as a share of its range."""
    return (signal - scene.low) / scene.span


FORMS = (holes_of_strap, wider_each_time, loops_of_thread)
