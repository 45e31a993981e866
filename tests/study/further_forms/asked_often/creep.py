"""Creep: the material relaxes over seconds to a minute after it is bent."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _slow(values: np.ndarray, time_s: float | np.ndarray, rate_hz: float) -> np.ndarray:
    """``values`` (T, N, S) followed with a time constant for each sensor, at rest before the first frame."""
    keep = np.exp(-1.0 / (np.broadcast_to(time_s, values.shape[2:]) * rate_hz))
    followed = np.empty_like(values)
    for sensor, kept in enumerate(keep):
        first = values[:, :1, sensor]
        part = lfilter([1 - kept], [1.0, -kept], values[:, :, sensor] - first, axis=1)
        followed[:, :, sensor] = first + part
    return followed


@form(
    Stage.MECHANICAL,
    "A spring beside a spring with a damper: it relaxes with one time constant (standard linear solid).",
    only_by_name=True,
)
def single_relaxation(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """After a bend the reading droops, and after straightening it comes back from below."""
    share = (signal - scene.low) / scene.span
    return signal - size * _slow(share, draws.each("time_s", 4.0, 20.0), scene.rate_hz)


@form(
    Stage.MECHANICAL,
    "Polymer that relaxes evenly in the logarithm of time, 1 to 50 s (Prony series of a power law, Findley).",
    only_by_name=True,
)
def logarithmic_relaxation(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Four time constants, three or four times apart, of about equal weight."""
    share = (signal - scene.low) / scene.span
    shortest, exponent = draws.one("shortest_s", 0.8, 1.5), draws.each("exponent", -0.1, 0.25)
    relaxed, total = np.zeros_like(share), np.zeros_like(exponent)
    for step in range(4):
        weight = np.exp(exponent * step)
        relaxed += weight * _slow(share, shortest * 3.3**step, scene.rate_hz)
        total += weight
    return signal - size * relaxed / total


@form(
    Stage.MECHANICAL,
    "Textile lengthens while the joint is bent far, and recovers more slowly than it gave way (ours).",
    only_by_name=True,
)
def slowly_recovering_textile(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Lengthening goes to the square of the bend, quickly upwards and slowly downwards."""
    load = np.clip((signal - scene.low) / scene.span, 0.0, 1.2) ** 2
    giving = draws.each("giving_s", 3.0, 10.0)
    returning = giving * draws.each("times_slower", 2.0, 4.0)
    quick, slow = (1 - np.exp(-1.0 / (time_s * scene.rate_hz)) for time_s in (giving, returning))
    longer, now = np.empty_like(load), load[:, 0]
    for frame in range(load.shape[1]):
        gap = load[:, frame] - now
        now = now + np.where(gap > 0, quick, slow) * gap
        longer[:, frame] = now
    return signal - size * longer


FORMS = (single_relaxation, logarithmic_relaxation, slowly_recovering_textile)
