"""Unknown context: readings follow a recorded quantity that no catalogue of causes knows.

Each form brings its column under a name of its own: a stray magnetic field, the pull of the cable and the
current through a heated bench. The columns wander within a take and differ between takes.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def field_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """A stray magnetic field of either sign, in microtesla."""
    return "stray_field_ut", 48.0 + 12.0 * _wander(scene, draws, "field")


def cable_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """The pull of the cable, in centinewtons, never below nought."""
    return "cable_pull_cn", 30.0 * np.exp(0.7 * _wander(scene, draws, "pull"))


def bench_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """The current through a bench, in milliamperes."""
    return "bench_current_ma", 400.0 + 90.0 * _wander(scene, draws, "current")


@form(
    Stage.WEARING,
    "The size of a recorded column's difference from one value, whichever its sign (a corner; ours).",
    only_by_name=True,
    touches="one_or_all",
    column=field_column,
)
def context_corner(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A straight fall and a straight rise on either side of one value of the column."""
    off = np.abs(field_column(scene, draws)[1] - draws.one("corner_ut", 43.0, 53.0)) / 12.0
    return signal + size * draws.signs() * 4.0 * (off - 0.8)[:, :, None]


@form(
    Stage.WEARING,
    "A recorded column changes the gain and levels off: the same share of it does less and less"
    " (Langmuir's shape).",
    only_by_name=True,
    touches="one_or_all",
    column=cable_column,
)
def context_levelling_gain(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Bends count more or less by the column over itself plus a constant."""
    pull = cable_column(scene, draws)[1]
    level = pull / (pull + draws.one("half_cn", 15.0, 45.0))
    share = (signal - scene.low) / scene.span
    return signal + size * draws.sign() * 12.0 * (level - 0.5)[:, :, None] * (0.15 + share)


@form(
    Stage.WEARING,
    "Readings follow the square of a recorded column with a delay of some seconds (heat of a current; ours).",
    only_by_name=True,
    touches="one_or_all",
    column=bench_column,
)
def context_heats_up(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The column's square passes one slow relaxation before it shows."""
    step = -np.expm1(-1 / (draws.one("heats_s", 3.0, 9.0) * scene.rate_hz))
    heat = np.square(bench_column(scene, draws)[1] / 400.0)
    warm = np.empty_like(heat)
    state = heat[:, 0]
    for frame in range(heat.shape[1]):
        state = state + step * (heat[:, frame] - state)
        warm[:, frame] = state
    return signal + size * draws.signs() * 8.0 * (warm - 1.0)[:, :, None]


def _wander(scene: Scene, draws: Draws, name: str) -> np.ndarray:
    """A quantity of unit size about nought: a level per take and three slow waves, shape (T, N)."""
    wander = np.empty((len(scene.starts), len(scene.time_s)))
    for take, start in enumerate(scene.starts):
        random = draws.stream(name, start.key)
        turns = scene.time_s / random.uniform(9.0, 45.0, (3, 1)) + random.random((3, 1))
        waves = np.sin(2 * np.pi * turns).sum(axis=0)
        wander[take] = np.clip(0.7 * random.standard_normal(), -1.4, 1.4) + 0.55 * waves
    return wander


FORMS = (context_corner, context_levelling_gain, context_heats_up)
