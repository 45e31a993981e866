"""Lag: an air tube with bellows, a filter against tremor, and a gel that thins when sheared."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


@form(
    Stage.ELECTRICAL,
    "Pressure runs through a tube, then fills a bellows: dead time and one pole (Ziegler & Nichols 1942).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def tube_and_bellows(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the sum of both times, which each tube shares out in its own way."""
    dead = draws.each("dead_share", 0.35, 0.65)
    fills, late = size * (1 - dead), size * dead
    keep = fills / (fills + 1 / scene.rate_hz)
    out = np.empty_like(signal)
    for place in range(signal.shape[2]):
        take = signal[:, :, place].T
        filled = lfilter([1 - keep[place]], [1.0, -keep[place]], take - take[0], axis=0) + take[0]
        out[:, :, place] = at_times(scene.time_s, filled, scene.time_s - late[place]).T
    return out


@form(
    Stage.ELECTRICAL,
    "A notch in each channel takes tremor of 8 to 11 Hz away and delays slower motion (notch filter).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def notch_against_tremor(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the delay of slow motion, which grows with the width of the notch."""
    out, at = np.empty_like(signal), 2 * np.pi * draws.each("notch_hz", 8.0, 11.0)
    warp = at / np.tan(at / (2 * scene.rate_hz))
    for place in range(signal.shape[2]):
        square, turn = warp[place] ** 2, at[place] ** 2
        wide = size[place] * turn * warp[place]
        above = [square + turn, 2 * (turn - square), square + turn]
        below = [square + wide + turn, 2 * (turn - square), square - wide + turn]
        take, start = signal[:, :, place], signal[:, :1, place]
        out[:, :, place] = lfilter(above, below, take - start, axis=1) + start
    return out


@form(
    Stage.ELECTRICAL,
    "A gel couples the strip to the skin and thins when sheared: quick far away, slow near (Cross 1965).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def gel_thins_when_sheared(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the time of the unsheared gel."""
    thins = draws.each("thins_deg", 6.0, 20.0)
    near, out = signal[:, 0], np.empty_like(signal)
    for frame in range(signal.shape[1]):
        missing = signal[:, frame] - near
        quick = (1 + np.abs(missing) / thins) / scene.rate_hz
        near = near + missing * quick / (size + quick)
        out[:, frame] = near
    return out


FORMS = (tube_and_bellows, notch_against_tremor, gel_thins_when_sheared)
