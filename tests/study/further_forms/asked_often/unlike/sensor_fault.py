"""Sensor fault: low bits that are lost, a cable that makes noise when moved, and a zero that is set anew."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


@form(
    Stage.CONVERTER,
    "A poor line loses the low bits of the converter's word: readings come in coarse steps (quantisation).",
    only_by_name=True,
    touches="one",
    sizes=(0.5, 60.0),
)
def low_bits_lost(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Size is the step in degrees; the lost bits read as if half of them were set."""
    step = np.maximum(size, 0.01)
    from_zero = signal + scene.counts_zero_deg
    coarse = step * (np.floor(from_zero / step) + 0.5) - scene.counts_zero_deg
    return np.where(size > 0, coarse, signal)


@form(
    Stage.CONVERTER,
    "A worn cable charges itself while the finger moves it: noise with the speed (triboelectric noise).",
    only_by_name=True,
    touches="one",
)
def cable_noise_when_moved(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Noise of some hundredths of a second, in proportion to the joint's speed of late; quiet at rest."""
    lasts, keep = draws.one("lasts_s", 0.02, 0.08), np.exp(-1 / (0.15 * scene.rate_hz))
    speed = np.abs(np.gradient(scene.own, axis=1)) * scene.rate_hz / 40.0
    moved = lfilter([1 - keep], [1.0, -keep], speed, axis=1)
    shape = signal.shape[1:]
    noise = [lasting_noise(draws.stream("rub", s.key), *shape, lasts, scene.rate_hz) for s in scene.starts]
    return signal + size * moved * np.stack(noise)


@form(
    Stage.CONVERTER,
    "The sensor's chip restarts at random and takes part of the bend for its zero (touch-sensor baseline).",
    only_by_name=True,
    touches="one",
)
def sets_its_zero_anew(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """From each restart to the next the reading is low by a part of the bend of that moment."""
    apart, frames = draws.one("apart_s", 6.0, 20.0), np.arange(signal.shape[1])
    found = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        restarts = draws.stream("restarts", start.key).random(len(frames)) < 1 / (apart * scene.rate_hz)
        last = np.maximum.accumulate(np.where(restarts, frames, 0))
        found[take] = signal[take, last] - scene.low
    return signal - size * 0.2 * found


FORMS = (low_bits_lost, cable_noise_when_moved, sets_its_zero_anew)
