"""Warm-up drift: readings move with the time since power-on, and begin anew after the glove was off.

The electronics warm by themselves: an oven that overshoots before it settles, a light source that dims, and
a thermistor that switches once it is warm.

A heater that is regulated rings, heat takes time to arrive, and a lamp burns in.

The amplifier may set itself to zero now and then, wander less and less, or warm a strip that is stiff when
cold.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erfc

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Zero points follow the heater of a voltage reference that overshoots and rings"
    " (oven-controlled reference).",
    only_by_name=True,
)
def oven_rings(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A swing about the final zero point that dies away since power-on."""
    on = _since_on(scene)
    ring_s = draws.one("ring_s", 90.0, 260.0)
    dies_s = draws.one("dies_s", 120.0, 260.0)
    swing = np.exp(-on / dies_s) * np.cos(2 * np.pi * on / ring_s)
    return signal + size * draws.signs() * draws.each("share", 0.6, 1.4) * 5.0 * swing


@form(
    Stage.ELECTRICAL,
    "A light-emitting diode dims as its junction warms: gains fall by a slow power of the time"
    " since power-on.",
    only_by_name=True,
)
def light_dims(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All of the light behind a reading fades, so that high readings lose most."""
    power = draws.one("power", 0.2, 0.6)
    bright = (1 + _since_on(scene) / draws.one("first_s", 10.0, 40.0)) ** -power
    usual = (1 + 200.0 / 25.0) ** -power
    light = (scene.counts_zero_deg + signal) / (scene.counts_zero_deg + scene.high)
    return signal + size * 10.0 * (bright - usual) * light


@form(
    Stage.ELECTRICAL,
    "A protecting thermistor heats itself past its switching point within the first minutes (PTC; ours).",
    only_by_name=True,
)
def thermistor_switches(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points stay, move within half a minute or so, and stay again."""
    moment = draws.one("moment_s", 60.0, 130.0) + draws.each("later_s", -15.0, 15.0)
    width = draws.each("width_s", 8.0, 25.0)
    switched = 0.5 + 0.5 * np.tanh((_since_on(scene) - moment) / width)
    return signal + size * draws.signs() * 5.0 * (switched - 0.5)


def _since_on(scene: Scene) -> np.ndarray:
    """Seconds since power-on, shape (T, N, 1), 0 before."""
    return np.maximum(scene.power_on_s, 0.0)[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Zero points swing about their rest, ever less, as a heated reference is regulated (damped oscillation).",
    only_by_name=True,
)
def regulated_heater(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A damped swing with its own depth per sensor."""
    dies_s, period_s = draws.one("dies_s", 90.0, 220.0), draws.one("period_s", 90.0, 200.0)
    since = _since(scene)
    swing = np.exp(-since / dies_s) * np.cos(2 * np.pi * since / period_s)
    return signal + size * draws.signs() * 2 * swing


@form(
    Stage.ELECTRICAL,
    "Zero points stay at first and move when the heat arrives through the board (erfc; Carslaw & Jaeger).",
    only_by_name=True,
)
def heat_arrives(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Heat from a distant source, after a travelling time of its own per sensor."""
    travels_s = draws.each("travels_s", 50.0, 250.0)
    arrived = erfc(np.sqrt(travels_s / np.maximum(_since(scene), 1e-3)))
    return signal + size * draws.signs() * 4 * (arrived - 0.3)


@form(
    Stage.ELECTRICAL,
    "A lamp burns in: all light falls with a power of the time since power-on (light-emitting diodes).",
    only_by_name=True,
)
def lamp_burns_in(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each degree counts less as the lamp loses its first brightness."""
    time_s, power = draws.one("time_s", 30.0, 120.0), draws.each("power", 0.4, 1.2)
    bright = (1 + _since(scene) / time_s) ** -power
    light = (signal - scene.low) / scene.span + draws.each("dark", 0.1, 0.4)
    return signal + size * 6 * light * (bright - 0.4)


def _since(scene: Scene) -> np.ndarray:
    return np.maximum(scene.power_on_s, 0)[:, :, None]


@form(
    Stage.ELECTRICAL,
    "An amplifier sets itself to zero every few minutes and drifts off between (periodic auto-zero).",
    only_by_name=True,
)
def auto_zero(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points show how far the amplifier has settled since it last set itself to zero."""
    every, settles = draws.one("every_s", 90.0, 240.0), draws.each("settles_s", 200.0, 500.0)
    now = _powered_s(scene)
    zeroed = np.floor(now / every) * every
    return signal + size * 5 * draws.signs() * (np.exp(-zeroed / settles) - np.exp(-now / settles))


@form(
    Stage.ELECTRICAL,
    "Zero points wander after power-on, ever less and ever slower (burn-in of contacts and films; ours).",
    only_by_name=True,
)
def wanders_ever_less(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each zero point follows waves of the logarithm of the time since power-on that die down."""
    fades = draws.each("fades_s", 150.0, 500.0)
    now = _powered_s(scene)
    age = np.log1p(now / 15.0)
    waves = np.zeros_like(signal)
    for number in (1, 2, 3):
        turns, phase = draws.each(f"turns_{number}", 0.15, 0.6), draws.each(f"phase_{number}", 0.0, 1.0)
        waves = waves + np.sin(2 * np.pi * (turns * age + phase))
    return signal + size * 2 * waves / (1 + now / fades)


@form(
    Stage.ELECTRICAL,
    "A strip is stiff until its own current has warmed it, and falls short of deep bends till then (ours).",
    only_by_name=True,
)
def stiff_until_warm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """From a certain bend on each sensor falls short, by less and less after power-on."""
    warms, from_bend = draws.each("warms_s", 80.0, 300.0), draws.each("from_bend", 0.15, 0.4)
    bend = np.clip((signal - scene.low) / scene.span, 0.0, 1.2)
    cold = np.exp(-_powered_s(scene) / warms)
    return signal - size * 6 * cold * np.maximum(bend - from_bend, 0.0)


def _powered_s(scene: Scene) -> np.ndarray:
    """Seconds since power-on, 0 before it, shape (T, N, 1)."""
    return np.maximum(scene.power_on_s, 0.0)[:, :, None]


FORMS = (
    oven_rings,
    light_dims,
    thermistor_switches,
    regulated_heater,
    heat_arrives,
    lamp_burns_in,
    auto_zero,
    wanders_ever_less,
    stiff_until_warm,
)
