"""Creep: a held bend goes on changing the reading for seconds to minutes, and is forgotten as slowly.

Water that leaves a foam makes a series of times of one diffusion; the time itself may depend on how far the
polymer is strained; and a layer behind another one begins to give only after the first has.

Wet padding drains, filled rubber loses its structure and rebuilds it, and paste flows only beyond a yield.

Only large strains creep, two layers creep against each other, or the give comes in jerks.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve, lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

SETTLED_S = 1.5


TERMS = 12


@form(
    Stage.MECHANICAL,
    "Fluid is squeezed from a soft layer: the series of times of one diffusion (poroelasticity; Biot 1941).",
    only_by_name=True,
)
def squeezed_fluid(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Every step of bend drains like a slab: with the root of time first, exponentially in the end."""
    drained = draws.one("drained_s", 15.0, 45.0)
    odd = (2 * np.arange(TERMS) + 1)[:, None]
    left = np.sum(8 / (np.pi * odd) ** 2 * np.exp(-(odd**2) * _ages(scene) / drained), axis=0)
    return signal + size * draws.sign() * _since_steps(signal, scene, 1.0 - left)


@form(
    Stage.MECHANICAL,
    "Strain opens free volume, so that a bent strip relaxes many times faster (Knauss & Emri 1981).",
    only_by_name=True,
)
def bend_quickens_creep(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One relaxation whose time falls exponentially with the bend at that moment."""
    straight_s = draws.each("straight_s", 20.0, 45.0)
    quicker = draws.each("quicker", 1.5, 2.7)
    share = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    step = -np.expm1(-1 / (straight_s * np.exp(-quicker * share) * scene.rate_hz))
    relaxed = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        state = state + step[:, frame] * (signal[:, frame] - state)
        relaxed[:, frame] = state
    usual = scene.low + 0.4 * scene.span
    return signal + size * draws.sign() * (relaxed - usual)


@form(
    Stage.MECHANICAL,
    "A layer behind the cloth gives only once the cloth has: creep that sets in late (two elements"
    " in a row; ours).",
    only_by_name=True,
)
def foam_behind_cloth(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The answer to a step of bend starts flat, rises after some seconds and levels off."""
    ages = _ages(scene) / draws.one("layer_s", 4.0, 11.0)
    return signal + size * draws.sign() * _since_steps(signal, scene, 1.0 - (1.0 + ages) * np.exp(-ages))


def _since_steps(signal: np.ndarray, scene: Scene, response: np.ndarray) -> np.ndarray:
    """The sum over all past changes of each change times ``response`` (N,) at its age, less what is quick."""
    response = response - response[np.searchsorted(_ages(scene), SETTLED_S)]
    steps = np.diff(signal, axis=1, prepend=signal[:, :1])
    return fftconvolve(steps, response[None, :, None], axes=1)[:, : signal.shape[1]]


def _ages(scene: Scene) -> np.ndarray:
    return np.arange(len(scene.time_s)) / scene.rate_hz


MODES = 3


@form(
    Stage.MECHANICAL,
    "Fluid is pressed slowly out of padding and drawn in again (consolidation series of Terzaghi 1925).",
    only_by_name=True,
)
def draining_padding(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A series of relaxations with the times of a draining layer: 1, 1/9 and 1/25 of the slowest."""
    slowest = draws.each("slowest_s", 18.0, 45.0)
    drained = np.zeros_like(signal)
    weights = np.array([1 / (2 * mode + 1) ** 2 for mode in range(MODES)])
    for mode, weight in enumerate(weights / weights.sum()):
        drained += weight * _followed(signal, slowest / (2 * mode + 1) ** 2, scene)
    return signal + size * draws.sign() * 0.2 * (drained - scene.low - 0.4 * scene.span)


@form(
    Stage.MECHANICAL,
    "Filled rubber loses its inner structure while bent and rebuilds it slowly (thixotropy; Moore 1959).",
    only_by_name=True,
)
def lost_structure(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The intact share of a structure sets how much of the bend is read."""
    breaks, heals = draws.each("breaks_s", 5.0, 14.0), draws.each("heals_s", 15.0, 45.0)
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    broken = np.empty_like(signal)
    state = bend[:, 0] / breaks / (bend[:, 0] / breaks + (1 - bend[:, 0]) / heals)
    for frame in range(signal.shape[1]):
        now = bend[:, frame]
        state = state + ((1 - state) * now / breaks - state * (1 - now) / heals) / scene.rate_hz
        broken[:, frame] = state
    return signal + size * draws.sign() * 10 * bend * (broken - 0.6)


@form(
    Stage.MECHANICAL,
    "A paste that flows only while the bend is more than a yield away from its rest (Bingham 1922).",
    only_by_name=True,
)
def yielding_paste(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The paste's rest follows with a time of its own, and only by what exceeds the yield."""
    limit, time_s = draws.each("yield_deg", 6.0, 14.0), draws.each("time_s", 6.0, 18.0)
    rest = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        away = signal[:, frame] - state
        state = state + (away - np.clip(away, -limit, limit)) / (time_s * scene.rate_hz)
        rest[:, frame] = state
    return signal + size * draws.sign() * 0.2 * (rest - scene.low - 0.4 * scene.span)


def _followed(signal: np.ndarray, time_s: np.ndarray, scene: Scene) -> np.ndarray:
    """The signal followed with a first-order lag per sensor, settled at the start."""
    followed = np.empty_like(signal)
    for channel, seconds in enumerate(time_s):
        keep = np.exp(-1 / (seconds * scene.rate_hz))
        column = signal[:, :, channel]
        followed[:, :, channel] = lfilter([1 - keep], [1, -keep], column, axis=1, zi=keep * column[:, :1])[0]
    return followed


@form(
    Stage.MECHANICAL,
    "Creep grows far more than in proportion with the strain (stress-dependent compliance; Schapery 1969).",
    only_by_name=True,
)
def deep_bends_creep(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A relaxation of a high power of the bend: little after small bends, much after deep ones."""
    seconds, power = draws.each("seconds", 6.0, 25.0), draws.each("power", 2.5, 4.0)
    bend = np.maximum(_bend(signal, scene), 0.0)
    return signal + size * 6 * draws.sign() * _follow(bend**power, seconds, scene.rate_hz)


@form(
    Stage.MECHANICAL,
    "A step rises for seconds and vanishes within a minute, as two layers give unequally fast (Kovacs 1963).",
    only_by_name=True,
)
def two_layers_cancel(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A quick layer's relaxation less a slow one's, so that a held bend is right at once and at last."""
    quick, slow = draws.each("quick_s", 1.5, 4.0), draws.each("slow_s", 12.0, 30.0)
    bend = _bend(signal, scene)
    hump = _follow(bend, quick, scene.rate_hz) - _follow(bend, slow, scene.rate_hz)
    return signal + size * 6 * draws.signs() * hump


@form(
    Stage.MECHANICAL,
    "Fibres slip past each other in small jerks while they relax (crackling of crumpled sheets).",
    only_by_name=True,
)
def gives_in_jerks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A relaxation that rests until its pent-up part lets go, which it then does at once."""
    seconds, jerk = draws.each("seconds", 6.0, 20.0), draws.each("jerk", 0.06, 0.15)
    smooth = _follow(_bend(signal, scene), seconds, scene.rate_hz)
    out = np.empty_like(signal)
    state = smooth[:, 0]
    for frame in range(signal.shape[1]):
        state = np.where(np.abs(smooth[:, frame] - state) > jerk, smooth[:, frame], state)
        out[:, frame] = state
    return signal + size * 6 * draws.sign() * out


def _bend(signal: np.ndarray, scene: Scene) -> np.ndarray:
    return np.clip((signal - scene.low) / scene.span, -0.2, 1.2)


def _follow(drive: np.ndarray, seconds: np.ndarray, rate_hz: float) -> np.ndarray:
    """A state that closes in on the drive with one time per sensor."""
    share = 1 - np.exp(-1 / (seconds * rate_hz))
    out = np.empty_like(drive)
    state = drive[:, 0]
    for frame in range(drive.shape[1]):
        state = state + share * (drive[:, frame] - state)
        out[:, frame] = state
    return out


FORMS = (
    squeezed_fluid,
    bend_quickens_creep,
    foam_behind_cloth,
    draining_padding,
    lost_structure,
    yielding_paste,
    deep_bends_creep,
    two_layers_cancel,
    gives_in_jerks,
)
