"""Unknown context: a cause outside every catalogue follows a recorded column of an unfamiliar name.

By how fast the column changes, with slack between, or as a stop whose place along the bend it sets.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def sway_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """Sway of a boom the cables hang from: slow waves, as in millimetres."""
    return "boom_sway", 12 * _waves(scene, draws, "sway", (5.0, 9.0, 17.0))


def spool_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """Turns of a spool that takes up thread."""
    return "spool_turns", 3 + _waves(scene, draws, "spool", (13.0, 31.0, 260.0, 900.0))


def shim_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """Thickness of a shim behind the strip, in hundredths of a millimetre."""
    return "shim_gauge", 40 + 10 * _waves(scene, draws, "shim", (19.0, 47.0, 380.0, 1300.0))


@form(
    Stage.WEARING,
    "Readings follow how fast a recorded column changes, whatever its value (drag; ours).",
    set_aside=True,
    touches="one_or_all",
    column=sway_column,
)
def context_speed(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is shifted in proportion to the column's speed."""
    speed = np.gradient(sway_column(scene, draws)[1], 1 / scene.rate_hz, axis=1)
    return signal + size * 0.2 * draws.signs() * draws.each("own", 0.6, 1.4) * speed[:, :, None]


@form(
    Stage.WEARING,
    "Readings follow a recorded column behind a slack, so they differ on its way up and down (backlash; ours).",
    set_aside=True,
    touches="one_or_all",
    column=spool_column,
)
def context_slack(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is shifted by a place that the column drags along from either side."""
    slack = draws.each("slack", 0.4, 0.9)
    turns = spool_column(scene, draws)[1][:, :, None]
    out = np.empty_like(signal)
    place = turns[:, 0] * np.ones(signal.shape[2])
    for frame in range(signal.shape[1]):
        place = np.clip(place, turns[:, frame] - slack, turns[:, frame] + slack)
        out[:, frame] = place
    return signal + size * 2 * draws.signs() * (out - 3)


@form(
    Stage.WEARING,
    "A recorded column sets the bend from which on a stop takes part of the reading away (ours).",
    set_aside=True,
    touches="one_or_all",
    column=shim_column,
)
def context_stop(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor falls short beyond a bend that goes up and down with the column."""
    at, moves = draws.each("at", 0.3, 0.5), draws.each("moves", 0.012, 0.025) * draws.sign()
    stop = at + moves * (shim_column(scene, draws)[1][:, :, None] - 40)
    bend = (signal - scene.low) / scene.span
    return signal - size * 10 * np.maximum(bend - stop, 0.0)


def _waves(scene: Scene, draws: Draws, name: str, periods_s: tuple[float, ...]) -> np.ndarray:
    """Waves over the session of about these periods, standard deviation 1, shape (T, N)."""
    random = draws.stream(name)
    turns = [scene.session_s / (period * random.uniform(0.8, 1.25)) + random.random() for period in periods_s]
    return np.sqrt(2 / len(periods_s)) * np.sum([np.sin(2 * np.pi * turn) for turn in turns], axis=0)


FORMS = (context_speed, context_slack, context_stop)
