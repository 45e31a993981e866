"""Repeated samples: frames repeat older readings."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


@form(
    Stage.TRANSPORT,
    "The glove reads its sensors more slowly than the link sends frames: each reading is sent again (ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.017, 1.0),
)
def glove_slower_than_link(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the time between new readings in seconds."""
    frames = np.arange(signal.shape[1])
    hold = max(size[0] * scene.rate_hz, 1.0)
    held = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        phase = draws.stream("phase", start.key).uniform(0.0, hold)
        newest = np.ceil(np.floor((frames + phase) / hold) * hold - phase - 1e-6).astype(int)
        held[take] = signal[take, np.clip(newest, 0, frames)]
    return held


@form(
    Stage.TRANSPORT,
    "Packets are lost on the radio link, often several in a row, and the last good one is repeated (ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.003, 0.97),
)
def lost_packets(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the share of frames that are lost."""
    frames = np.arange(signal.shape[1])
    lasts_s = draws.one("fade_s", 0.05, 0.15)
    held = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("fading", start.key)
        fading = lasting_noise(random, len(frames), 1, lasts_s, scene.rate_hz)[:, 0]
        good = ndtr(fading) >= size[0]
        newest = np.maximum.accumulate(np.where(good, frames, 0))
        held[take] = signal[take, newest]
    return held


@form(
    Stage.TRANSPORT,
    "A multiplexer reads a sensor at a time, a frame holds older readings of the rest (round robin; ours).",
    only_by_name=True,
    shared=True,
    sizes=(0.017, 1.0),
)
def sensors_read_in_turn(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the time of a whole round in seconds; the sensors' turns are spread evenly over it."""
    frames = np.arange(signal.shape[1])
    sensors = signal.shape[2]
    turns = draws.stream("turns").permutation(sensors) / sensors
    draws.values["turns"] = [round(float(turn), 6) for turn in turns]
    hold = max(size[0] * scene.rate_hz, 1.0)
    held = np.empty_like(signal)
    for sensor, turn in enumerate(turns):
        newest = np.ceil((np.floor(frames / hold + turn) - turn) * hold - 1e-6).astype(int)
        held[:, :, sensor] = signal[:, np.clip(newest, 0, frames), sensor]
    return held


FORMS = (glove_slower_than_link, lost_packets, sensors_read_in_turn)
