"""A cause outside every catalogue, of which only a recorded column of an unfamiliar name tells.

Each form brings a column of its own, which is recorded without error and moves by itself.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


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
    set_aside=True,
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
    set_aside=True,
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
    set_aside=True,
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


FORMS = (context_levels, context_vee, context_pivot)
