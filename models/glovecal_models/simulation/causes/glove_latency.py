"""Glove latency: the whole glove is late by the same time, because of its transport, buffers and filters.

Wireless sensors come 10 to 40 ms late (Santos, NIME 2021), play-out buffers against radio jitter add some
tens of milliseconds, and a linear-phase filter half its length. No sensor is later than another.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times

SIZES_S = (0.002, 0.4)


@form(
    Stage.COUNTS,
    "Every reading comes late by the same time (wireless transport; Santos, NIME 2021).",
    sizes=SIZES_S,
    shared=True,
)
def transport(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One delay of ``size`` seconds for all sensors and the whole session."""
    return _late(signal, scene, np.full(scene.session_s.shape, size[0]))


@form(
    Stage.COUNTS,
    "A play-out buffer that fills and empties a little, as the glove's clock and the computer's differ.",
    sizes=SIZES_S,
    shared=True,
)
def buffered(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A delay around ``size`` seconds that grows and falls back, batch by batch of some seconds."""
    depth, period_s = draws.one("depth_share", 0.05, 0.2), draws.one("period_s", 5.0, 20.0)
    sawtooth = np.mod(scene.session_s / period_s + draws.one("phase", 0.0, 1.0), 1.0) - 0.5
    return _late(signal, scene, size[0] * (1 + depth * sawtooth))


@form(
    Stage.COUNTS,
    "A linear-phase filter, the same for all sensors: late by half its length (firmware).",
    sizes=SIZES_S,
    shared=True,
)
def linear_phase(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A symmetric raised-cosine window, late by ``size`` seconds."""
    half = max(float(size[0]), 1e-6) * scene.rate_hz
    ago = np.arange(int(np.ceil(2 * half)) + 1)
    weights = 1 + np.cos(np.pi * np.clip((ago - half) / (half + 0.5), -1.0, 1.0))
    weights /= weights.sum()
    centre = float(weights @ ago)
    start = signal[:, :1]
    passed = lfilter(weights, [1.0], signal - start, axis=1) + start
    # the window has whole frames, its middle is where the size says
    return _late(passed, scene, np.full(scene.session_s.shape, (half - centre) / scene.rate_hz))


@form(
    Stage.COUNTS,
    "A moving average in the firmware, the same for all sensors: late by half its window.",
    sizes=SIZES_S,
    shared=True,
)
def common_average(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The mean of the last whole frames, late by ``size`` seconds."""
    frames = max(1, round(2 * float(size[0]) * scene.rate_hz) + 1)
    start = signal[:, :1]
    passed = lfilter(np.full(frames, 1 / frames), [1.0], signal - start, axis=1) + start
    left_s = float(size[0]) - (frames - 1) / 2 / scene.rate_hz
    return _late(passed, scene, np.full(scene.session_s.shape, left_s))


def _late(signal: np.ndarray, scene: Scene, delay_s: np.ndarray) -> np.ndarray:
    return np.stack(
        [
            at_times(scene.time_s, values, scene.time_s - delay)
            for values, delay in zip(signal, delay_s, strict=True)
        ]
    )


def _late_by(signal: np.ndarray, scene: Scene, delay_s: np.ndarray | float) -> np.ndarray:
    """Every take as it was ``delay_s`` earlier: one number or, shape (N,), one for each time."""
    return np.stack([at_times(scene.time_s, take, scene.time_s - delay_s) for take in signal])


@form(
    Stage.TRANSPORT,
    "Every reading arrives the same time later (serial link, driver and queue; pure transport delay).",
    sizes=(0.002, 0.4),
    shared=True,
    only_by_name=True,
)
def transport_delay(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All channels are shifted by the size in seconds and by nothing else."""
    return _late_by(signal, scene, size[0])


@form(
    Stage.TRANSPORT,
    "All channels pass a symmetric filter, which delays all frequencies alike (linear-phase filter).",
    sizes=(0.002, 0.4),
    shared=True,
    only_by_name=True,
)
def linear_phase_filter(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nine taps of a raised cosine around the size in seconds, over a part of the time that is available."""
    half_width_s = size[0] * draws.one("share", 0.3, 0.8)
    taps = np.arange(-4, 5) / 5
    weights = (1 + np.cos(np.pi * taps)) / 10
    parts = [
        weight * _late_by(signal, scene, size[0] + half_width_s * tap)
        for tap, weight in zip(taps, weights, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=0))


@form(
    Stage.TRANSPORT,
    "Frames travel in batches and are stamped in quick succession on arrival (packets of radio links).",
    sizes=(0.002, 0.4),
    shared=True,
    only_by_name=True,
)
def stamped_in_batches(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The delay falls while a batch's frames are stamped and rises until the next; its mean is the size."""
    batch_s = max(size[0], 1e-6) * draws.one("batch", 0.5, 1.2)
    quick = draws.one("quick", 0.3, 0.6)
    told = draws.one("told", 0.8, 0.95)
    phase = (scene.time_s / batch_s + draws.one("phase", 0.0, 1.0)) % 1.0
    ahead = np.interp(phase, [0.0, quick, 1.0], [0.0, told, 1.0]) - phase
    return _late_by(signal, scene, size[0] + batch_s * ((told - quick) / 2 - ahead))


FORMS = (
    transport,
    buffered,
    linear_phase,
    common_average,
    transport_delay,
    linear_phase_filter,
    stamped_in_batches,
)
