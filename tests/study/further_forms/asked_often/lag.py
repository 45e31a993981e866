"""Lag: each sensor comes after its joint by a short memory of its own."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _follow(values: np.ndarray, time_s: float, rate_hz: float) -> np.ndarray:
    """First-order low pass of ``values`` (T, N), exact for straight lines between frames."""
    keep = np.exp(-1.0 / (time_s * rate_hz))
    middle = (1 - keep) * time_s * rate_hz
    first = values[:, :1]
    return np.asarray(first + lfilter([1 - middle, middle - keep], [1.0, -keep], values - first, axis=1))


@form(
    Stage.ELECTRICAL,
    "One resistor and capacitor before the converter's input, or soft rubber: a first-order low pass.",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def input_capacitor(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the time constant in seconds."""
    followed = [_follow(signal[:, :, k], float(size[k]), scene.rate_hz) for k in range(signal.shape[2])]
    return np.stack(followed, axis=2)


@form(
    Stage.ELECTRICAL,
    "Soft padding and a filter one after the other: a second-order low pass without overshoot (ours).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def padding_and_filter(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the sum of both time constants in seconds."""
    part = draws.each("first_share", 0.5, 0.7)
    stages = []
    for k in range(signal.shape[2]):
        padded = _follow(signal[:, :, k], float(size[k] * part[k]), scene.rate_hz)
        stages.append(_follow(padded, float(size[k] * (1 - part[k])), scene.rate_hz))
    return np.stack(stages, axis=2)


@form(
    Stage.ELECTRICAL,
    "Elastic springs back less readily than it is pulled: a low pass, slower when straightening (ours).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def slower_springing_back(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the time constant of straightening in seconds; that of bending is a share of it."""
    bending = size * draws.each("bending_share", 0.3, 0.6)
    steps = 4
    down, up = (1 - np.exp(-1.0 / (time_s * scene.rate_hz * steps)) for time_s in (size, bending))
    late, now = np.empty_like(signal), signal[:, 0]
    before = signal[:, 0]
    for frame in range(signal.shape[1]):
        for step in range(1, steps + 1):
            gap = before + (signal[:, frame] - before) * (step / steps) - now
            now = now + np.where(gap > 0, up, down) * gap
        before = signal[:, frame]
        late[:, frame] = now
    return late


FORMS = (input_capacitor, padding_and_filter, slower_springing_back)
