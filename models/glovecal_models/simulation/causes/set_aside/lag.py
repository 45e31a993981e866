"""Set-aside forms of a sensor that follows its joint with a short low-pass of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

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
    set_aside=True,
    sizes=(0.002, 0.8),
)
def distributed_line(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The response of an open line's far end, with the size as its mean delay in seconds."""
    delay_s = size * draws.each("share", 0.8, 1.2)
    return _through(signal, scene.rate_hz, lambda rate: 1 / np.cosh(np.sqrt(2 * delay_s * rate)))


@form(
    Stage.ELECTRICAL,
    "A second-order low-pass that overshoots a little (Sallen-Key filter with complex poles).",
    set_aside=True,
    sizes=(0.002, 0.8),
)
def overshooting(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two complex poles, with the size as the delay of slow motion in seconds."""
    damping = draws.each("damping", 0.45, 0.7)
    inertia = (size / (2 * damping)) ** 2
    return _through(signal, scene.rate_hz, lambda rate: 1 / (1 + size * rate + inertia * rate**2))


@form(
    Stage.ELECTRICAL,
    "A low-pass that opens when the joint moves fast (1 Euro filter in firmware; Casiez et al. 2012).",
    set_aside=True,
    sizes=(0.002, 0.8),
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


FORMS = (distributed_line, overshooting, opens_when_fast)
