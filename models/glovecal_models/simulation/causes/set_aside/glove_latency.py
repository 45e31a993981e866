"""Set-aside forms of a whole glove whose readings arrive late and are stamped when they arrive."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import at_times


def _late(signal: np.ndarray, scene: Scene, delay_s: np.ndarray | float) -> np.ndarray:
    """The signal of every take as it was ``delay_s`` earlier."""
    return np.stack([at_times(scene.time_s, take, scene.time_s - delay_s) for take in signal])


@form(
    Stage.TRANSPORT,
    "Every reading arrives the same time later (serial link, driver and queue; pure transport delay).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def transport_delay(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All channels are shifted by the size in seconds and by nothing else."""
    return _late(signal, scene, size[0])


@form(
    Stage.TRANSPORT,
    "All channels pass a symmetric filter, which delays all frequencies alike (linear-phase filter).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def linear_phase_filter(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nine taps of a raised cosine around the size in seconds, over a part of the time that is available."""
    half_width_s = size[0] * draws.one("share", 0.3, 0.8)
    taps = np.arange(-4, 5) / 5
    weights = (1 + np.cos(np.pi * taps)) / 10
    parts = [
        weight * _late(signal, scene, size[0] + half_width_s * tap)
        for tap, weight in zip(taps, weights, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=0))


@form(
    Stage.TRANSPORT,
    "Frames travel in batches and are stamped in quick succession on arrival (packets of radio links).",
    set_aside=True,
    sizes=(0.002, 0.4),
    shared=True,
)
def stamped_in_batches(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The delay falls while a batch's frames are stamped and rises until the next; its mean is the size."""
    batch_s = max(size[0], 1e-6) * draws.one("batch", 0.5, 1.2)
    quick = draws.one("quick", 0.3, 0.6)
    told = draws.one("told", 0.8, 0.95)
    phase = (scene.time_s / batch_s + draws.one("phase", 0.0, 1.0)) % 1.0
    ahead = np.interp(phase, [0.0, quick, 1.0], [0.0, told, 1.0]) - phase
    return _late(signal, scene, size[0] + batch_s * ((told - quick) / 2 - ahead))


FORMS = (transport_delay, linear_phase_filter, stamped_in_batches)
