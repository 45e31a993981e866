"""Glove latency: all sensors come late by the same delay."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


@form(
    Stage.COUNTS,
    "Radio link and driver deliver every frame after the same time (pure delay; ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 0.4),
)
def steady_link_delay(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the delay in seconds."""
    return np.stack([at_times(scene.time_s, take, scene.time_s - size[0]) for take in signal])


@form(
    Stage.COUNTS,
    "The firmware smooths all sensors with a running mean: late by half its window (linear-phase filter).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 0.4),
)
def firmware_running_mean(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the delay in seconds, half the window."""
    window = 2 * size[0]
    early = scene.time_s[0]
    means = []
    for take in signal:
        sums = CubicSpline(scene.time_s, take, axis=0).antiderivative()
        ends = np.maximum(scene.time_s, early + window)
        means.append((sums(ends) - sums(ends - window)) / window)
    return np.stack(means)


@form(
    Stage.COUNTS,
    "A queue of frames between glove and program fills and drains slowly: late by a wandering delay (ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.002, 0.4),
)
def filling_queue(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the usual delay in seconds; it wanders over tens of seconds by some part of itself."""
    wander, period = draws.one("wander", 0.2, 0.45), draws.one("period_s", 20.0, 60.0)
    late = []
    for start, take in zip(scene.starts, signal, strict=True):
        phase = draws.stream("phase", start.key).uniform(0, 2 * np.pi)
        delay = size[0] * (1 + wander * np.sin(2 * np.pi * scene.time_s / period + phase))
        late.append(at_times(scene.time_s, take, scene.time_s - delay))
    return np.stack(late)


FORMS = (steady_link_delay, firmware_running_mean, filling_queue)
