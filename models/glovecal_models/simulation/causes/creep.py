"""Creep: a held bend goes on changing the reading for seconds to minutes, and is forgotten as slowly.

Bend and strain sensors on polymer relax after every change of strain, with several times at once (BYU,
Sensors 22(14) 5239, 2022); a flex sensor behaves as a standard linear solid (Springer
10.1007/978-3-030-25261-8_34). Slow laws without a time of their own are as common: a logarithm or a power.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve, lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

SETTLED_S = 1.5


@form(Stage.MECHANICAL, "One relaxation time (standard linear solid; Springer 10.1007/978-3-030-25261-8_34).")
def one_exponential(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One Maxwell element: the bend of the last ``time_s`` seconds is added."""
    followed = _followed(signal, draws.each("time_s", 3.0, 25.0), scene)
    return signal + size * draws.sign() * (followed - _usual(scene))


@form(
    Stage.MECHANICAL, "A fast and a slow relaxation together (generalised Maxwell; BYU, Sensors 22(14) 5239)."
)
def two_exponentials(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A fast and a slow Maxwell element."""
    share = draws.each("fast_share", 0.3, 0.7)
    fast = _followed(signal, draws.each("fast_s", 1.0, 4.0), scene)
    slow = _followed(signal, draws.each("slow_s", 12.0, 40.0), scene)
    return signal + size * draws.sign() * (share * fast + (1 - share) * slow - _usual(scene))


@form(
    Stage.MECHANICAL, "Growth with the logarithm of the time since each bend (logarithmic creep of polymers)."
)
def logarithm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Every step of bend grows with the logarithm of the time since it."""
    start = draws.one("start_s", 0.2, 1.5)
    return signal + size * draws.sign() * _since_steps(signal, scene, np.log1p(_ages(scene) / start))


@form(
    Stage.MECHANICAL,
    "Growth with a small power of the time since each bend (Nutting 1921; fractional Kelvin-Voigt).",
)
def power_law(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Every step of bend grows with a small power of the time since it."""
    power = draws.one("power", 0.15, 0.45)
    return signal + size * draws.sign() * _since_steps(signal, scene, _ages(scene) ** power)


def _followed(signal: np.ndarray, time_s: np.ndarray, scene: Scene) -> np.ndarray:
    """The signal followed with a first-order lag per sensor, settled at the start."""
    followed = np.empty_like(signal)
    for channel, seconds in enumerate(time_s):
        keep = np.exp(-1 / (seconds * scene.rate_hz))
        column = signal[:, :, channel]
        state = keep * column[:, :1]
        followed[:, :, channel] = lfilter([1 - keep], [1, -keep], column, axis=1, zi=state)[0]
    return followed


def _since_steps(signal: np.ndarray, scene: Scene, response: np.ndarray) -> np.ndarray:
    """The sum over all past changes of each change times ``response`` (N,) at its age.

    The response counts from its value after ``SETTLED_S``, so that everyday moves keep the static curve's
    gain.
    """
    response = response - response[np.searchsorted(_ages(scene), SETTLED_S)]
    steps = np.diff(signal, axis=1, prepend=signal[:, :1])
    return fftconvolve(steps, response[None, :, None], axes=1)[:, : signal.shape[1]]


def _usual(scene: Scene) -> np.ndarray:
    """The bend around which a hand moves; a constant, so that readings keep to the converter's range."""
    return scene.low + 0.4 * scene.span


def _ages(scene: Scene) -> np.ndarray:
    return np.arange(len(scene.time_s)) / scene.rate_hz


@form(
    Stage.MECHANICAL,
    "Relaxation by a stretched exponential of the time since each bend (Kohlrausch 1854; polymers).",
    only_by_name=True,
)
def stretched_exponential(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What is still missing after each bend falls with the exponential of a power of time."""
    time_s = draws.each("time_s", 8.0, 40.0)
    power = draws.each("power", 0.35, 0.6)
    bend = (signal - scene.low) / scene.span
    bends = np.diff(bend, axis=1, prepend=bend[:, :1])
    since = np.arange(bend.shape[1])[:, None] / scene.rate_hz
    remains = np.exp(-((since / time_s) ** power))[None]
    missing = fftconvolve(bends, remains, axes=1)[:, : bend.shape[1]]
    return signal + size * 4 * (bend - missing - 0.4)


@form(
    Stage.MECHANICAL,
    "Flow with the hyperbolic sine of what is missing: fast when far, very slow when near (Eyring 1936).",
    only_by_name=True,
)
def eyring_flow(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A crept part follows the bend at a speed that grows more than in proportion to its distance."""
    near = draws.each("near", 0.12, 0.25)
    time_s = draws.each("time_s", 12.0, 45.0)
    bend = (signal - scene.low) / scene.span
    crept = np.empty_like(bend)
    now = bend[:, 0]
    for step in range(bend.shape[1]):
        crept[:, step] = now
        drive = np.clip((bend[:, step] - now) / near, -7.0, 7.0)
        now = now + near / (time_s * scene.rate_hz) * np.sinh(drive)
    return signal + size * 4 * (crept - 0.4)


@form(
    Stage.MECHANICAL,
    "Cloth gives within seconds under load and recovers several times slower (knitted fabrics; shape ours).",
    only_by_name=True,
)
def slow_recovery(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A crept part follows the bend with one time when it is pulled on and a longer one when it is let go."""
    giving_s = draws.each("giving_s", 2.5, 8.0)
    recovering_s = giving_s * draws.each("slower", 3.0, 7.0)
    bend = (signal - scene.low) / scene.span
    crept = np.empty_like(bend)
    now = bend[:, 0]
    for step in range(bend.shape[1]):
        crept[:, step] = now
        missing = bend[:, step] - now
        now = now + missing / (np.where(missing > 0, giving_s, recovering_s) * scene.rate_hz)
    return signal + size * 4 * (crept - 0.55)


FORMS = (
    two_exponentials,
    one_exponential,
    logarithm,
    power_law,
    stretched_exponential,
    eyring_flow,
    slow_recovery,
)
