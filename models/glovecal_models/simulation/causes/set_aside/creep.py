"""Set-aside forms of a sensor that goes on moving while its joint is held, and is slow to forget it."""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.MECHANICAL,
    "Relaxation by a stretched exponential of the time since each bend (Kohlrausch 1854; polymers).",
    set_aside=True,
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
    set_aside=True,
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
    set_aside=True,
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


FORMS = (stretched_exponential, eyring_flow, slow_recovery)
