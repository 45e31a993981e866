"""Lag: the sensor's electronics or firmware smooths the signal, so that it comes late and flattened.

Delays of 25 ms are measured for wireless sensors (Santos, NIME 2021); filters of amplifiers and firmware are
set to 5 to 150 ms by choice. Every sensor has its own.
"""

from __future__ import annotations

from collections.abc import Callable

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


PAD_S = 8.0


def _through(signal: np.ndarray, rate_hz: float, response: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The signal behind a linear filter whose response is given for complex frequencies of shape (F, 1).

    The signal is closed to a ring by a smooth way back from its end to its beginning.
    """
    frames = signal.shape[1]
    pad = round(PAD_S * rate_hz)
    back = 0.5 - 0.5 * np.cos(np.pi * (np.arange(pad) + 1) / (pad + 1))[:, None]
    way_back = signal[:, -1:] + back * (signal[:, :1] - signal[:, -1:])
    ring = np.concatenate([signal, way_back], axis=1)
    frequency = 2j * np.pi * np.fft.rfftfreq(ring.shape[1], 1 / rate_hz)[:, None]
    spectrum = np.fft.rfft(ring, axis=1) * response(frequency)
    return np.asarray(np.fft.irfft(spectrum, ring.shape[1], axis=1)[:, :frames])


@form(
    Stage.ELECTRICAL,
    "A resistive strip with capacitance to the skin all along it (diffusion; distributed RC line).",
    sizes=(0.002, 0.8),
    only_by_name=True,
)
def distributed_line(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The response of an open line's far end, with the size as its mean delay in seconds."""
    delay_s = size * draws.each("share", 0.8, 1.2)
    return _through(signal, scene.rate_hz, lambda rate: 1 / np.cosh(np.sqrt(2 * delay_s * rate)))


@form(
    Stage.ELECTRICAL,
    "A second-order low-pass that overshoots a little (Sallen-Key filter with complex poles).",
    sizes=(0.002, 0.8),
    only_by_name=True,
)
def overshooting(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two complex poles, with the size as the delay of slow motion in seconds."""
    damping = draws.each("damping", 0.45, 0.7)
    inertia = (size / (2 * damping)) ** 2
    return _through(signal, scene.rate_hz, lambda rate: 1 / (1 + size * rate + inertia * rate**2))


@form(
    Stage.ELECTRICAL,
    "A low-pass that opens when the joint moves fast (1 Euro filter in firmware; Casiez et al. 2012).",
    sizes=(0.002, 0.8),
    only_by_name=True,
)
def opens_when_fast(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A first-order low-pass whose time, the size at rest in seconds, shrinks with the smoothed speed."""
    fast = draws.each("fast_deg_s", 80.0, 250.0)
    smooth = -np.expm1(-2 * np.pi * draws.one("speed_cutoff_hz", 0.8, 2.0) / scene.rate_hz)
    times_rate = np.maximum(size, 1e-6) * scene.rate_hz
    follows = np.empty_like(signal)
    follows[:, 0] = now = signal[:, 0]
    speed = np.zeros_like(now)
    for step in range(1, signal.shape[1]):
        moved = (signal[:, step] - signal[:, step - 1]) * scene.rate_hz
        speed = speed + smooth * (moved - speed)
        now = now - np.expm1(-(1 + np.abs(speed) / fast) / times_rate) * (signal[:, step] - now)
        follows[:, step] = now
    return follows


FORMS = (
    one_pole,
    two_poles,
    moving_average,
    distributed_line,
    overshooting,
    opens_when_fast,
)
