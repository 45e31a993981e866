"""Lag: the sensor's electronics or firmware smooths the signal, so that it comes late and flattened.

Delays of 25 ms are measured for wireless sensors (Santos, NIME 2021); filters of amplifiers and firmware are
set to 5 to 150 ms by choice. Every sensor has its own.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

SIZES_S = (0.002, 0.8)


@form(
    Stage.ELECTRICAL,
    "A first-order low-pass with its own time per sensor (resistor and capacitor).",
    sizes=SIZES_S,
)
def one_pole(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A resistor and a capacitor; the size is their time in seconds."""
    return _smoothed(signal, size, scene)


@form(
    Stage.ELECTRICAL, "Two first-order low-passes in a row (anti-alias filter and amplifier).", sizes=SIZES_S
)
def two_poles(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two of them in a row, the second faster; the size is the sum of their times."""
    share = draws.each("second_share", 0.2, 0.5)
    return _smoothed(_smoothed(signal, size * (1 - share), scene), size * share, scene)


@form(
    Stage.ELECTRICAL,
    "The mean of a window of past readings (firmware of data-acquisition boards).",
    sizes=SIZES_S,
)
def moving_average(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The mean of the last ``size`` seconds, as firmware takes it."""
    start = signal[:, :1]
    result = np.empty_like(signal)
    for channel, seconds in enumerate(size):
        weights = _window(max(float(seconds), 1e-6) * scene.rate_hz)
        result[:, :, channel] = lfilter(weights, [1.0], (signal - start)[:, :, channel], axis=1)
    return result + start


def _window(frames: float) -> np.ndarray:
    """Weights of the newest frame and those before it in the mean over ``frames``, not a whole number.

    Between frames the signal is taken as straight: each frame weighs what its triangle has in the window.
    """

    def area(x: np.ndarray) -> np.ndarray:
        x = np.clip(x, -1.0, 1.0)
        return np.where(x < 0, (1 + x) ** 2 / 2, 1 - (1 - x) ** 2 / 2)

    ago = np.arange(int(np.ceil(frames)) + 1)
    return (area(frames - ago) - area(-ago.astype(float))) / frames


def _smoothed(signal: np.ndarray, time_s: np.ndarray, scene: Scene) -> np.ndarray:
    """First-order lag per sensor, exact for a signal that is straight between frames."""
    result = np.empty_like(signal)
    for channel, seconds in enumerate(time_s):
        ratio = max(float(seconds), 1e-6) * scene.rate_hz
        keep = np.exp(-1 / ratio)
        now, before = 1 - (1 - keep) * ratio, (1 - keep) * ratio - keep
        column = signal[:, :, channel]
        state = column[:, :1] * (1 - now)
        result[:, :, channel] = lfilter([now, before], [1, -keep], column, axis=1, zi=state)[0]
    return result


FORMS = (one_pole, two_poles, moving_average)
