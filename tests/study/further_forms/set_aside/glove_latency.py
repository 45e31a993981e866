"""Set-aside forms of glove latency."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _low_pass(values: np.ndarray, tau_s: np.ndarray | float, rate_hz: float) -> np.ndarray:
    """First-order lag along axis 1."""
    share = 1.0 - np.exp(-1.0 / (rate_hz * np.asarray(tau_s)))
    followed = np.empty_like(values)
    state = values[:, 0].copy()
    for n in range(values.shape[1]):
        state += share * (values[:, n] - state)
        followed[:, n] = state
    return followed


def _seen_late(signal: np.ndarray, time_s: np.ndarray, delay_s: np.ndarray) -> np.ndarray:
    """The signal as it was ``delay_s`` (T, N) before."""
    late = np.empty_like(signal)
    for take, delays in enumerate(delay_s):
        for column in range(signal.shape[2]):
            late[take, :, column] = np.interp(time_s - delays, time_s, signal[take, :, column])
    return late


@form(
    Stage.TRANSPORT,
    "The receiver's playout buffer becomes longer when packets came late and shorter after quiet "
    "minutes (Ramjee and others 1994).",
    set_aside=True,
    shared=True,
    sizes=(0.001, 0.2),
)
def playout_buffer_adapts(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Delays that stay for some seconds, then move to another length; the size is about their mean."""
    stays = draws.one("stays_s", 4.0, 12.0)
    delays = np.empty((len(scene.starts), scene.time_s.size))
    for take, start in enumerate(scene.starts):
        random = draws.stream("buffer", start.key)
        changes = np.cumsum(random.uniform(0.5, 1.5, 60)) * stays + scene.time_s[0]
        lengths = random.choice([0.5, 0.75, 1.0, 1.4, 1.8], 61)
        delays[take] = lengths[np.searchsorted(changes, scene.time_s)]
    delays = _low_pass(delays, 0.5, scene.rate_hz)
    return _seen_late(signal, scene.time_s, float(np.max(size)) * delays)


@form(
    Stage.TRANSPORT,
    "The driver smooths all sensors with a filter that opens with speed, so that slow movement is "
    "late and fast movement less so (1-euro filter, Casiez, Roussel and Vogel 2012).",
    set_aside=True,
    shared=True,
    sizes=(0.001, 0.2),
)
def speed_opens_filter(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """First order; the size is twice the time constant at rest, in seconds."""
    opens = draws.one("opens_deg_s", 150.0, 400.0)
    tau, step = max(2.0 * float(np.max(size)), 1e-6), 1.0 / scene.rate_hz
    followed = np.empty_like(signal)
    state, before = signal[:, 0].copy(), signal[:, 0]
    speed = np.zeros_like(state)
    for n in range(signal.shape[1]):
        speed += 0.1 * ((signal[:, n] - before) / step - speed)
        share = -np.expm1(-step * (1.0 + np.abs(speed) / opens) / tau)
        state += share * (signal[:, n] - state)
        followed[:, n] = state
        before = signal[:, n]
    return followed


@form(
    Stage.TRANSPORT,
    "The glove sends slightly faster than the host reads, so a serial buffer fills and is thrown away"
    " when full (buffer overruns in USB serial driver notes).",
    set_aside=True,
    shared=True,
    sizes=(0.001, 0.2),
)
def serial_queue_fills(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A delay that grows from a third of its largest value, falls back and grows again."""
    period, phase = draws.one("period_s", 8.0, 30.0), draws.one("phase", 0.0, 1.0)
    full = 0.3 + 1.4 * ((scene.session_s / period + phase) % 1.0)
    return _seen_late(signal, scene.time_s, float(np.max(size)) * full)


FORMS: tuple[Form, ...] = (playout_buffer_adapts, speed_opens_filter, serial_queue_fills)
