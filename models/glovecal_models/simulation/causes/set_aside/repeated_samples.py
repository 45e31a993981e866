"""Repeated samples: old readings come again in place of new ones.

While the radio signal fades, while a buffer is played in a loop, or when packets arrive out of order.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


@form(
    Stage.TRANSPORT,
    "Echoes cancel the radio signal now and then, and the last frame is shown on (fading; Rayleigh, Clarke 1968).",
    set_aside=True,
    sizes=(0.005, 0.97),
    shared=True,
)
def signal_fades(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Frames are lost while the strength of two noisy parts of the signal together is below a level."""
    lasts = draws.one("lasts_s", 0.15, 0.5)
    frames = signal.shape[1]
    lost = np.empty(signal.shape[:2], dtype=bool)
    for take, start in enumerate(scene.starts):
        parts = lasting_noise(draws.stream("echoes", start.key), frames, 2, lasts, scene.rate_hz)
        lost[take] = (parts**2).sum(axis=1) / 2 < -np.log1p(-size[0])
    return _shown(signal, np.maximum.accumulate(np.where(lost, 0, np.arange(frames)), axis=1))


@form(
    Stage.TRANSPORT,
    "When no data come, the driver plays its ring buffer again and again (as stuttering sound does).",
    set_aside=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def ring_buffer_again(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In each pause of the link, up to some tenths of a second before it come again in a loop."""
    apart, pause = draws.one("apart_s", 1.5, 3.5), max(round(size[0] * scene.rate_hz), 1)
    ring = min(max(round(draws.one("ring_s", 0.1, 0.4) * scene.rate_hz), 2), pause)
    frames = signal.shape[1]
    shown = np.tile(np.arange(frames), (len(signal), 1))
    for take, start in enumerate(scene.starts):
        gaps = draws.stream("gaps", start.key).exponential(apart, frames) * scene.rate_hz
        first = ring
        for gap in gaps:
            first += int(gap)
            if first >= frames:
                break
            many = np.arange(min(pause, frames - first))
            shown[take, first + many] = first - ring + many % ring
            first += pause
    return _shown(signal, shown)


@form(
    Stage.TRANSPORT,
    "Some packets take a longer way and overwrite newer ones on arrival (UDP does not keep order; RFC 768).",
    set_aside=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def out_of_order(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Single frames among new ones are older by a time that differs from one to the next."""
    share = draws.one("share", 0.12, 0.3)
    frames = signal.shape[1]
    shown = np.empty(signal.shape[:2], dtype=int)
    for take, start in enumerate(scene.starts):
        random = draws.stream("packets", start.key)
        age = np.ceil(size[0] * scene.rate_hz * random.uniform(0.4, 1.0, frames))
        late = random.random(frames) < share
        shown[take] = np.maximum(np.arange(frames) - np.where(late, age, 0.0), 0).astype(int)
    return _shown(signal, shown)


def _shown(signal: np.ndarray, frame: np.ndarray) -> np.ndarray:
    return np.take_along_axis(signal, frame[:, :, None], axis=1)


FORMS = (signal_fades, ring_buffer_again, out_of_order)
