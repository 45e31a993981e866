"""Unknown context: readings follow a recorded quantity that no catalogue of causes knows.

Each form brings its column under a name of its own: a stray magnetic field, the pull of the cable and the
current through a heated bench. The columns wander within a take and differ between takes.

Each form brings a column of its own, which is recorded without error and moves by itself.

By how fast the column changes, with slack between, or as a stop whose place along the bend it sets.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


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


def thread_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """A whole number from 0 to 4 that changes every few tens of seconds."""
    stays_s, shift_s = draws.one("stays_s", 9.0, 16.0), draws.one("shift_s", 0.0, 60.0)
    block = np.floor((scene.session_s + shift_s) / stays_s).astype(int)
    blocks, where = np.unique(block, return_inverse=True)
    numbers = [draws.stream("thread", int(number) + 1000).integers(5) for number in blocks]
    return "weft_index", np.array(numbers, dtype=float)[where.reshape(block.shape)]


def hum_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """A level in decibels that swells and falls within tens of seconds."""
    return "hum_level_db", 42.0 + 6.0 * _moves(scene, draws, draws.one("lasts_s", 12.0, 30.0))


def ply_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """A skew in millimetres that wanders about nothing."""
    return "ply_skew_mm", 1.5 * _moves(scene, draws, draws.one("lasts_s", 8.0, 20.0))


@form(
    Stage.WEARING,
    "A level of its own for each value of a recorded whole number, in no order (ours).",
    only_by_name=True,
    touches="one_or_all",
    column=thread_column,
)
def context_levels(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Five shuffled levels, one for each value of the column."""
    levels = draws.stream("levels").permutation([-1.4, -0.7, 0.0, 0.7, 1.4])
    return signal + size * draws.sign() * 2 * levels[thread_column(scene, draws)[1].astype(int)][:, :, None]


@form(
    Stage.WEARING,
    "The distance of a recorded column from one value, whichever side it is on (ours).",
    only_by_name=True,
    touches="one_or_all",
    column=hum_column,
)
def context_vee(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A corner at one value, with a steeper and a gentler side."""
    away = (hum_column(scene, draws)[1] - draws.one("corner", 39.0, 45.0)) / 6.0
    vee = np.where(away > 0, draws.one("right", 0.6, 1.6), -draws.one("left", 0.6, 1.6)) * away
    return signal + size * draws.sign() * 2 * vee[:, :, None]


@form(
    Stage.WEARING,
    "A recorded column turns the curve about mid-range: up at one end, down at the other (ours).",
    only_by_name=True,
    touches="one_or_all",
    column=ply_column,
)
def context_pivot(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A levelling function of the column times the distance from a pivot in the range."""
    turned = np.tanh(ply_column(scene, draws)[1] / draws.one("scale", 0.8, 2.0))[:, :, None]
    arm = (signal - scene.low) / scene.span - draws.one("pivot", 0.35, 0.55)
    return signal + size * draws.sign() * 8 * turned * arm


def _moves(scene: Scene, draws: Draws, lasts_s: float) -> np.ndarray:
    """A smooth wandering value about 0 with deviation 1, shape (T, N), of its own in each take."""
    smooth = np.hanning(2 * round(scene.rate_hz) + 1)
    rows = []
    for start in scene.starts:
        random = draws.stream("moves", start.key)
        rough = lasting_noise(random, len(scene.time_s) + len(smooth) - 1, 1, lasts_s, scene.rate_hz)[:, 0]
        rows.append(np.convolve(rough, smooth / smooth.sum(), mode="valid"))
    return np.stack(rows)


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
    only_by_name=True,
    touches="one_or_all",
    column=sway_column,
)
def context_speed(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor is shifted in proportion to the column's speed."""
    speed = np.gradient(sway_column(scene, draws)[1], 1 / scene.rate_hz, axis=1)
    return signal + size * 0.2 * draws.signs() * draws.each("own", 0.6, 1.4) * speed[:, :, None]


@form(
    Stage.WEARING,
    "Readings follow a recorded column behind a slack, so they differ on its way up and down"
    " (backlash; ours).",
    only_by_name=True,
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
    only_by_name=True,
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


FORMS = (
    context_corner,
    context_levelling_gain,
    context_heats_up,
    context_levels,
    context_vee,
    context_pivot,
    context_speed,
    context_slack,
    context_stop,
)
