"""Supply sag: readings follow the voltage that feeds the glove, as its battery empties.

An amplifier loses headroom at its upper end first, firmware corrects by a gauge that knows a few levels
only, and the input current that loads a wiper changes with the supply.

Firmware corrects for a battery it measures coarsely, headroom shrinks, and a bias starves near the cut-off.

An input stage may change over elsewhere, ripple may grow, or the cell's own resistance may show.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

USUAL_V = 4.04


@form(
    Stage.ELECTRICAL,
    "An amplifier's upper end is pressed together as the supply takes its headroom (output swing;"
    " shape ours).",
    only_by_name=True,
)
def top_loses_headroom(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """High readings come out too low in proportion to the missing voltage, low ones stay right."""
    power = draws.one("power", 2.5, 4.5)
    share = np.clip((signal - scene.low) / scene.span, 0.0, 1.15)
    return signal + size * 100.0 * _above_usual(scene) * share**power


@form(
    Stage.ELECTRICAL,
    "Firmware corrects for the supply by a battery gauge of few levels; the rest within a level is"
    " left (ours).",
    only_by_name=True,
)
def gauge_of_few_levels(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The error falls with the voltage and leaps back where the gauge falls by a level."""
    level_v = draws.one("level_v", 0.05, 0.09)
    left = np.mod(scene.supply_v / level_v + draws.one("first_level", 0.0, 1.0), 1.0) - 0.5
    loses = draws.each("gain_share", 0.2, 0.6)
    share = (signal - scene.low) / scene.span
    return signal + size * 6.0 * left[:, :, None] * (1 - loses + 2 * loses * share)


@form(
    Stage.ELECTRICAL,
    "An input current that changes with the supply loads a sensor wired as a wiper (loading error"
    " of dividers).",
    only_by_name=True,
)
def loaded_wiper(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The source resistance is highest past mid-range, and there the error bows; it is small at both ends."""
    share = np.clip((signal - scene.low) / scene.span, -0.1, 1.1)
    way = draws.each("wiper_from", 0.0, 0.15) + draws.each("wiper_way", 0.8, 0.85) * share
    return signal + size * draws.sign() * 400.0 * _above_usual(scene) * way**2 * (1 - way)


def _above_usual(scene: Scene) -> np.ndarray:
    """Volts above what is usual in mid-session, shape (T, N, 1)."""
    return scene.supply_v[:, :, None] - USUAL_V


@form(
    Stage.COUNTS,
    "Firmware corrects the gain by the voltage in coarse steps: a sawtooth of the voltage stays (ours).",
    only_by_name=True,
    sizes=(0.003, 20.0),
    shared=True,
)
def coarsely_corrected(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Raw counts are off by what lies between the voltage and the step it was rounded to."""
    step_v = draws.one("step_v", 0.04, 0.09)
    steps = scene.supply_v / step_v + draws.one("edge", 0.0, 1.0)
    missed = (steps - np.round(steps))[:, :, None]
    return signal + size * 0.05 * missed * (signal + scene.counts_zero_deg)


@form(
    Stage.ELECTRICAL,
    "An amplifier's headroom falls with the voltage, so that bent joints read lower.",
    only_by_name=True,
)
def headroom_shrinks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What exceeds a soft limit is lost in part, and the limit falls with the voltage."""
    limit = draws.each("limit", 0.4, 0.55) + draws.one("per_volt", 2.0, 4.0) * (
        scene.supply_v[:, :, None] - 4.0
    )
    soft = draws.one("soft", 0.04, 0.1)
    over = ((signal - scene.low) / scene.span - limit) / soft
    return signal - size * 10 * soft * np.logaddexp(0, over)


@form(
    Stage.ELECTRICAL,
    "A bias current starves exponentially near the cut-off, and the curve sags in mid-range (ours).",
    only_by_name=True,
)
def bias_starves(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A bow over the bend, right at both ends, that deepens exponentially as the voltage falls."""
    starved = np.exp((4.0 - scene.supply_v[:, :, None]) / draws.one("scale_v", 0.03, 0.08))
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    return signal - size * 4 * bend * (1 - bend) * (starved - 1)


@form(
    Stage.ELECTRICAL,
    "A rail-to-rail input changes from one pair of transistors to the other a volt below the supply"
    " (data sheets).",
    only_by_name=True,
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
    only_by_name=True,
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
    only_by_name=True,
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


FORMS = (
    top_loses_headroom,
    gauge_of_few_levels,
    loaded_wiper,
    coarsely_corrected,
    headroom_shrinks,
    bias_starves,
    input_pair_changes,
    ripple_grows,
    cell_resistance,
)
