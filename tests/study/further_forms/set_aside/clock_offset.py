"""Set-aside forms of clock offset."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _seen_late(signal: np.ndarray, time_s: np.ndarray, delay_s: np.ndarray) -> np.ndarray:
    """The signal as it was ``delay_s`` (T, N) before."""
    late = np.empty_like(signal)
    for take, delays in enumerate(delay_s):
        for column in range(signal.shape[2]):
            late[take, :, column] = np.interp(time_s - delays, time_s, signal[take, :, column])
    return late


@form(
    Stage.CLOCK,
    "The camera system begins to count at its shutter's trigger, which comes a fixed time away from "
    "the glove's own start (motion capture synchronisation manuals).",
    set_aside=True,
    shared=True,
    sizes=(0.001, 0.15),
)
def fixed_trigger_delay(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One and the same offset in the whole session."""
    return _seen_late(signal, scene.time_s, np.full(scene.supply_v.shape, float(np.max(size))))


@form(
    Stage.CLOCK,
    "Both clocks are set against each other by one message before each take, whose way there and back"
    " is not equally long (Cristian 1989).",
    set_aside=True,
    shared=True,
    sizes=(0.001, 0.15),
)
def one_message_each_take(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A new offset for each take, mostly to one side, now and then to the other."""
    side = draws.sign()
    takes = [draws.stream("message", start.key).gamma(2.0, 0.5) - 0.15 for start in scene.starts]
    delays = float(np.max(size)) * side * np.clip(takes, -0.15, 2.5)
    return _seen_late(signal, scene.time_s, np.repeat(delays[:, None], scene.time_s.size, axis=1))


@form(
    Stage.CLOCK,
    "Two free-running quartz clocks, aligned once, part slowly by their different rates and wander "
    "with the warmth of the room (oscillator stability, Allan 1966).",
    set_aside=True,
    shared=True,
    sizes=(0.001, 0.15),
)
def quartz_parts_and_wanders(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing when aligned, then a ramp over the session with a slow wave."""
    period, phase = draws.one("period_s", 500.0, 1500.0), draws.one("phase_rad", 0.0, 2 * np.pi)
    ramp = scene.session_s / draws.one("ramp_s", 600.0, 1500.0)
    wave = np.sin(2 * np.pi * scene.session_s / period + phase) - np.sin(phase)
    delays = float(np.max(size)) * draws.sign() * (ramp + 0.25 * wave)
    return _seen_late(signal, scene.time_s, delays)


FORMS: tuple[Form, ...] = (fixed_trigger_delay, one_message_each_take, quartz_parts_and_wanders)
