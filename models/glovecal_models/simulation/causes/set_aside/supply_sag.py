"""Supply sag: readings change as the battery's voltage falls.

An input stage may change over elsewhere, ripple may grow, or the cell's own resistance may show.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "A rail-to-rail input changes from one pair of transistors to the other a volt below the supply (data sheets).",
    set_aside=True,
)
def input_pair_changes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each reading has a small step at a bend that falls with the supply voltage."""
    moves, width = draws.each("ranges_per_volt", 1.2, 3.0), draws.each("width", 0.02, 0.08)
    at = draws.each("at", 0.25, 0.6) + moves * (scene.supply_v[:, :, None] - 3.95)
    bend = _bend(signal, scene)
    return signal + size * 2 * draws.signs() * np.tanh((bend - at) / width)


@form(
    Stage.ELECTRICAL,
    "A converter's ripple grows as its input falls, and sampling folds it down to a slow beat (aliasing).",
    set_aside=True,
)
def ripple_grows(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All readings swing together at a few hertz, the more the lower the voltage."""
    beat, drift = draws.one("beat_hz", 0.4, 3.0), draws.one("drift_hz", 0.05, 0.3)
    full, own = draws.one("full_v", 4.0, 4.15), draws.each("own", 0.6, 1.4)
    turns = beat * scene.session_s + drift / 0.3 * np.sin(0.3 * scene.session_s)
    height = np.maximum(full - scene.supply_v, 0.0) / 0.15
    return signal + size * 1.5 * own * (height * np.sin(2 * np.pi * turns))[:, :, None]


@form(
    Stage.ELECTRICAL,
    "The cell's own resistance rises as it empties and shows all sensors' current (internal resistance).",
    set_aside=True,
)
def cell_resistance(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each reading drops by the current of all sensors, straight ones drawing most, once the cell is low."""
    knee, width = draws.one("knee_v", 3.86, 4.0), draws.one("width_v", 0.03, 0.08)
    growth, part = draws.each("growth", 0.8, 2.5), draws.each("part", 0.2, 0.6)
    bend = np.clip(_bend(scene.own, scene), 0.0, 1.1)
    current = (1 / (1 + growth * bend)).mean(axis=2, keepdims=True)
    low_cell = 1 / (1 + np.exp((scene.supply_v[:, :, None] - knee) / width))
    return signal - size * 6 * low_cell * current * (part + (1 - part) * bend)


def _bend(angle: np.ndarray, scene: Scene) -> np.ndarray:
    """Each sensor's bend as a share of its range."""
    return (angle - scene.low) / scene.span


FORMS = (input_pair_changes, ripple_grows, cell_resistance)
