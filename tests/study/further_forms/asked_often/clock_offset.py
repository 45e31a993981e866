"""Clock offset: the reference's clock differs from the glove's."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


def _seen(signal: np.ndarray, scene: Scene, offset_s: np.ndarray) -> np.ndarray:
    """The angles at times that are off by ``offset_s`` (T, N) or (T, 1)."""
    shifted = scene.time_s + offset_s
    seen = [at_times(scene.time_s, take, times) for take, times in zip(signal, shifted, strict=True)]
    return np.stack(seen)


@form(
    Stage.CLOCK,
    "Both clocks were set once, not quite alike: the same offset for the whole session (ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 1.2),
)
def clocks_set_apart(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the offset in seconds."""
    return _seen(signal, scene, np.full((len(signal), 1), draws.sign() * size[0]))


@form(
    Stage.CLOCK,
    "Two quartzes of slightly different rate, set alike at the start: the offset grows with session time.",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 1.2),
)
def quartz_rates_differ(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the offset in seconds after half an hour; the first setting leaves a small rest."""
    rest = draws.one("rest", -0.1, 0.1)
    offset = draws.sign() * size[0] * (rest + scene.session_s / 1800.0)
    return _seen(signal, scene, np.clip(offset, -2.9, 2.9))


@form(
    Stage.CLOCK,
    "Each take is started on two computers by a command or a clap: the offset is new for each take (ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 1.2),
)
def takes_started_apart(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the spread of the offset over takes in seconds, about a mean that may be off as well."""
    mean = draws.one("mean", -0.5, 0.5)
    apart = [mean + draws.stream("start", start.key).uniform(-1.7, 1.7) for start in scene.starts]
    return _seen(signal, scene, size[0] * np.array(apart)[:, None])


FORMS = (clocks_set_apart, quartz_rates_differ, takes_started_apart)
