"""Set-aside forms of a reference whose clock differs from the glove's by a time that changes."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


def _moved(signal: np.ndarray, scene: Scene, offset_s: np.ndarray) -> np.ndarray:
    """The signal read at other times, which differ by ``offset_s`` of shape (T, N)."""
    times = scene.time_s + offset_s
    return np.stack([at_times(scene.time_s, take, when) for take, when in zip(signal, times, strict=True)])


@form(
    Stage.CLOCK,
    "The clocks run apart and are set right again at even intervals (sawtooth of periodic syncing).",
    set_aside=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def resynchronised(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The difference grows from nothing to the size in seconds, then starts again."""
    period_s = draws.one("period_s", 12.0, 45.0)
    phase = draws.one("phase", 0.0, 1.0)
    grown = (scene.session_s / period_s + phase) % 1.0
    return _moved(signal, scene, draws.sign() * size[0] * grown)


@form(
    Stage.CLOCK,
    "Each take begins with a time difference that a clock servo pulls in (phase-locked loop; shape ours).",
    set_aside=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def pulled_in(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The difference begins each take with the size in seconds and falls exponentially to a small rest."""
    servo_s = draws.one("servo_s", 5.0, 20.0)
    rest = draws.one("rest", 0.0, 0.2)
    left = rest + (1 - rest) * np.exp(-np.maximum(scene.time_s, 0.0) / servo_s)
    return _moved(signal, scene, np.tile(draws.sign() * size[0] * left, (len(signal), 1)))


@form(
    Stage.CLOCK,
    "The time difference wanders to and fro (network time with a path delay that varies; shape ours).",
    set_aside=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def wandering(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The difference is a sum of three waves, slow enough that time never runs backwards."""
    waves = []
    for shortest_s in (13.0, 21.0, 34.0):
        turns = scene.session_s / draws.one(f"period_s_{shortest_s:g}", shortest_s, 1.4 * shortest_s)
        waves.append(np.sin(2 * np.pi * (turns + draws.one(f"phase_{shortest_s:g}", 0.0, 1.0))))
    return _moved(signal, scene, size[0] * 0.5 * np.sum(waves, axis=0))


FORMS = (resynchronised, pulled_in, wandering)
