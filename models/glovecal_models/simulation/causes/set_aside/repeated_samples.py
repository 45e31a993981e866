"""Repeated samples: frames of the stream show the readings of an earlier frame again, all channels together.

A housekeeping task holds the stream up, a driver refuses what it thinks impossible, or hops fail.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.TRANSPORT,
    "A housekeeping task of the receiver holds the stream up at even intervals (garbage collection, disk).",
    set_aside=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def housekeeping(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The stream stands still for a set time, runs for a set time, and so on."""
    runs_s = draws.one("runs_s", 0.5, 1.6)
    phase = (scene.session_s + draws.one("phase_s", 0.0, 5.0)) % (runs_s + size[0])
    return _held(signal, phase >= size[0])


@form(
    Stage.TRANSPORT,
    "The driver refuses frames too far from the last one taken, for a while (plausibility check; ours).",
    set_aside=True,
    sizes=(0.02, 3.0),
    shared=True,
)
def refused_as_implausible(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A frame is refused if any joint jumped too far; after a while the next frame is taken anyway."""
    limit_deg = draws.one("limit_deg", 1.5, 3.0)
    # A patience between two frames is now the shorter, now the longer, so that it grows evenly.
    part = np.stack([draws.stream("part", start.key).random(len(scene.time_s)) for start in scene.starts])
    fresh = np.ones(signal.shape[:2], dtype=bool)
    last, waited = scene.own[:, 0], np.zeros(signal.shape[0])
    for frame in range(1, signal.shape[1]):
        now = scene.own[:, frame]
        near = np.abs(now - last).max(axis=1) <= limit_deg
        taken = near | (waited + part[:, frame] >= size[0] * scene.rate_hz)
        last = np.where(taken[:, None], now, last)
        waited = np.where(taken, 0, waited + 1)
        fresh[:, frame] = taken
    return _held(signal, fresh)


@form(
    Stage.TRANSPORT,
    "The link hops over 37 channels, some of them busy, so that the same hops fail in every round (BLE).",
    set_aside=True,
    sizes=(0.005, 0.97),
    shared=True,
)
def busy_hops(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Frames sent on a busy channel are lost; which ones repeats every 37 frames."""
    channels = 37
    hop = int(draws.one("hop", 5.0, 16.99))
    rank = draws.stream("busy").permutation(channels)
    frame = np.round(scene.session_s * scene.rate_hz).astype(int)
    # The channel at the edge is busy for a part of its frames, so that the loss grows evenly with the size.
    edge = np.stack([draws.stream("edge", start.key).random(len(scene.time_s)) for start in scene.starts])
    return _held(signal, rank[(frame * hop) % channels] + edge >= size[0] * channels)


def _held(signal: np.ndarray, fresh: np.ndarray) -> np.ndarray:
    """Every frame (T, N) that is not fresh shows the last one that was."""
    last = np.maximum.accumulate(np.where(fresh, np.arange(fresh.shape[1]), 0), axis=1)
    return np.take_along_axis(signal, last[:, :, None], axis=1)


FORMS = (housekeeping, refused_as_implausible, busy_hops)
