"""Repeated samples: a frame that did not arrive is filled with the one before.

Manus gloves in Motive run at 90 Hz without hardware synchronisation, "missing samples padded with the
previous" (docs.optitrack.com). Readings then are older than their stamps say, sometimes.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

BURSTS_PER_S = (0.2, 0.8)


@form(
    Stage.TRANSPORT,
    "Frames missing at random are filled with the one before (Manus in Motive, docs.optitrack.com).",
    sizes=(0.005, 0.97),
    shared=True,
)
def padded_at_random(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Every frame is missing with the same chance; the size is that chance."""
    return _held(signal, _chances(scene, draws) < size[0])


@form(
    Stage.TRANSPORT,
    "The glove is slower than the stream that carries it, so that frames repeat in a beat.",
    sizes=(1.02, 40.0),
    shared=True,
)
def periodic(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A glove slower than its stream: the size is the number of frames between fresh ones."""
    frames = np.arange(len(scene.time_s)) + draws.one("phase", 0.0, 1.0)
    fresh = np.diff(np.floor(frames / size[0]), prepend=-1) > 0
    return _held(signal, np.broadcast_to(~fresh, scene.session_s.shape))


@form(
    Stage.TRANSPORT,
    "The stream stands still for a while now and then (radio retransmission).",
    sizes=(0.02, 3.0),
    shared=True,
)
def bursts(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The stream stands still for a while and goes on; the size is how long, seconds, in the mean."""
    begins = _chances(scene, draws) < draws.one("per_s", *BURSTS_PER_S) / scene.rate_hz
    length = np.stack(
        [
            draws.stream("length", start.key).uniform(0.5, 1.5, len(scene.time_s)) * size[0] * scene.rate_hz
            for start in scene.starts
        ]
    )
    frames = np.arange(len(scene.time_s))
    ends = np.maximum.accumulate(np.where(begins, frames + length, -1.0), axis=1)
    return _held(signal, frames < ends)


def _chances(scene: Scene, draws: Draws) -> np.ndarray:
    """Shape (T, N), uniform 0 to 1; the same at every size, so that more size only adds repeats."""
    return np.stack([draws.stream("chance", start.key).random(len(scene.time_s)) for start in scene.starts])


def _held(signal: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Each missing frame, shape (T, N), replaced by the last one that is not."""
    frames = np.arange(signal.shape[1])
    last = np.maximum.accumulate(np.where(missing, 0, frames), axis=1)
    return np.take_along_axis(signal, last[:, :, None], axis=1)


FORMS = (padded_at_random, periodic, bursts)
