"""Clock offset: the reference's times differ from the glove's, whatever the glove does.

Times counted from frame numbers, two time servers, a crystal that settles: all concern the reference alone.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


@form(
    Stage.CLOCK,
    "Times counted from frame numbers at a wrong rate: a ramp from each take's first frame.",
    set_aside=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def counted_frames(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The time difference is nothing at a take's start and grows evenly until its end."""
    take_s = np.array([start.take_s for start in scene.starts])[:, None]
    return _read(signal, scene, size[0] * draws.sign() * scene.time_s / take_s)


@form(
    Stage.CLOCK,
    "The reference's computer listens to two time servers in turn, which disagree (network time; ours).",
    set_aside=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def two_servers(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The time difference changes to and fro between two values at random moments."""
    other = draws.one("other", -0.4, 0.3)
    stays_s = draws.one("stays_s", 12.0, 40.0)
    offset = np.empty((len(scene.starts), len(scene.time_s)))
    for row, start in enumerate(scene.starts):
        random = draws.stream("switches", start.key)
        moments = np.cumsum(random.exponential(stays_s, 60)) + scene.time_s[0]
        turn = np.searchsorted(moments, scene.time_s) + random.integers(2)
        offset[row] = np.where(turn % 2 == 0, 1.0, other)
    return _read(signal, scene, size[0] * draws.sign() * offset)


@form(
    Stage.CLOCK,
    "A crystal settles: the difference gained levels off over the session (ours).",
    set_aside=True,
    sizes=(0.002, 1.2),
    shared=True,
)
def settling_crystal(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reference's clock gains or loses at a rate that dies away."""
    settles_s = draws.one("settles_s", 200.0, 900.0)
    offset = -np.expm1(-np.maximum(scene.session_s, 0) / settles_s)
    return _read(signal, scene, size[0] * draws.sign() * offset)


def _read(signal: np.ndarray, scene: Scene, offset_s: np.ndarray) -> np.ndarray:
    """The reference read ``offset_s`` (T, N) earlier."""
    times = scene.time_s - offset_s
    return np.stack([at_times(scene.time_s, take, now) for take, now in zip(signal, times, strict=True)])


FORMS = (counted_frames, two_servers, settling_crystal)
