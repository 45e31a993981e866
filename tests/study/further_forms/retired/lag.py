"""Lag: a sensor's reading follows its signal late by hundredths to tenths of a second, each in its own way.

The memory is fast and belongs to one channel: a capacitor that the sensor itself has to charge, the median
of the last readings, or a rectifier that charges through a diode and discharges through a resistor.

The memory may be a limit to the speed, unequal for rise and fall, or the flow through a hole.

Only a part of it may be late, a tracking filter may run past, or a photocell be sluggish in the dark.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

SIZES = (0.002, 0.8)


@form(
    Stage.ELECTRICAL,
    "The sensor's own resistance charges the input's capacitor: a low-pass whose time grows with the bend"
    " (flex sensor and filter capacitor).",
    only_by_name=True,
    sizes=SIZES,
)
def own_resistance_charges(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A first-order low-pass, several times slower for a bent joint than for a straight one."""
    straight = draws.each("straight_share", 0.2, 0.4)
    share = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    time_s = np.maximum(size, 1e-6) * (straight + (2 - 2 * straight) * share)
    step = -np.expm1(-1 / (time_s * scene.rate_hz))
    output = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        state = state + step[:, frame] * (signal[:, frame] - state)
        output[:, frame] = state
    return output


@form(
    Stage.ELECTRICAL,
    "The median of a window of past readings (spike filter of sensor firmware; Tukey 1977).",
    only_by_name=True,
    sizes=SIZES,
)
def median_of_last(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor gives the middle one of its last readings, between two window lengths where need be."""
    window = 2 * size * draws.each("length", 0.8, 1.2) * scene.rate_hz
    output = np.empty_like(signal)
    for channel, frames in enumerate(window):
        half = int(frames / 2)
        share = frames / 2 - half
        shorter = _median(signal[:, :, channel], half)
        output[:, :, channel] = (1 - share) * shorter + share * _median(signal[:, :, channel], half + 1)
    return output


@form(
    Stage.ELECTRICAL,
    "A rectifier that charges through a diode and discharges through a resistor (envelope detector).",
    only_by_name=True,
    sizes=SIZES,
)
def diode_detector(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Quick one way and several times slower the other way; which way depends on the sensor's wiring."""
    way = draws.sign()
    slow = -np.expm1(-1 / (np.maximum(size, 1e-6) * scene.rate_hz))
    charging = np.maximum(size, 1e-6) * draws.each("charging_share", 0.1, 0.25)
    quick = -np.expm1(-1 / (charging * scene.rate_hz))
    output = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        missing = signal[:, frame] - state
        state = state + np.where(way * missing > 0, quick, slow) * missing
        output[:, frame] = state
    return output


def _median(values: np.ndarray, half: int) -> np.ndarray:
    """The median of the last ``2 * half + 1`` values along the second axis."""
    return median_filter(values, size=(1, 2 * half + 1), mode="nearest", origin=(0, half))  # pyright: ignore


@form(
    Stage.ELECTRICAL,
    "An amplifier that cannot change faster than its slew rate (operational amplifiers with small currents).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def slew_rate(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The output runs after the input at no more than a highest speed."""
    step = 0.3 * scene.span * draws.each("speed", 0.8, 1.3) / size / scene.rate_hz
    out = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        state = state + np.clip(signal[:, frame] - state, -step, step)
        out[:, frame] = state
    return out


@form(
    Stage.ELECTRICAL,
    "Rises quickly and falls slowly, or the other way (peak detector: diode, capacitor, resistor).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def peak_detector(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A first-order lag with one time while rising and several times that while falling."""
    ratio = draws.each("ratio", 3.0, 6.0)
    upward = draws.sign() > 0
    slow, fast = 1 - np.exp(-1 / (size * scene.rate_hz)), 1 - np.exp(-ratio / (size * scene.rate_hz))
    rise, fall = (fast, slow) if upward else (slow, fast)
    out = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        away = signal[:, frame] - state
        state = state + np.where(away > 0, rise, fall) * away
        out[:, frame] = state
    return out


@form(
    Stage.ELECTRICAL,
    "Fluid in a bent tube passes an orifice at a speed with the root of the pressure (Torricelli 1643).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def orifice(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The reading closes in with the root of what is missing, and so arrives in a finite time."""
    per_frame = np.sqrt(0.25 * scene.span * draws.each("bore", 0.7, 1.4)) / size / scene.rate_hz
    out = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        away = signal[:, frame] - state
        missing = np.abs(away)
        state = state + np.sign(away) * np.minimum(missing, per_frame * np.sqrt(missing))
        out[:, frame] = state
    return out


@form(
    Stage.ELECTRICAL,
    "A part of the strip follows at once, the rest through a gel layer (spring and damper; Zener solid).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def part_in_gel(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The prompt signal and a first-order lag of it are mixed, the late part being the larger one."""
    late = draws.each("late_share", 0.6, 0.9)
    keep = np.exp(-1 / (2 * np.maximum(size, 1e-6) * scene.rate_hz))
    out = np.empty_like(signal)
    state = signal[:, 0]
    for frame in range(signal.shape[1]):
        state = signal[:, frame] + keep * (state - signal[:, frame])
        out[:, frame] = state
    return (1 - late) * signal + late * out


@form(
    Stage.ELECTRICAL,
    "Firmware tracks place and speed: right at even speed, late at every turn (alpha-beta filter).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def tracks_place_and_speed(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A critically damped alpha-beta filter (Benedict & Bordner 1962) with one memory per sensor."""
    keep = np.exp(-1 / (draws.each("memory", 0.8, 1.2) * size * scene.rate_hz))
    alpha, beta = 1 - keep**2, (1 - keep) ** 2
    out = np.empty_like(signal)
    place, speed = signal[:, 0], np.zeros_like(signal[:, 0])
    for frame in range(signal.shape[1]):
        missing = signal[:, frame] - place - speed
        place, speed = place + speed + alpha * missing, speed + beta * missing
        out[:, frame] = place
    return out


@form(
    Stage.ELECTRICAL,
    "Carriers of a photocell recombine in pairs, so that it is quick in light and slow in the dark"
    " (Rose 1963).",
    only_by_name=True,
    sizes=(0.002, 0.8),
)
def photocell(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A state closes in on the light by the difference of both squares; light falls or rises with bend."""
    dark = draws.each("dark_level", 0.15, 0.35)
    away = draws.signs("light_goes") < 0
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.1)
    light = np.sqrt(dark**2 + np.where(away, 1.1 - bend, bend + 0.1) ** 2)
    now = light[:, 0]
    late = np.empty_like(signal)
    for frame in range(signal.shape[1]):
        target = light[:, frame]
        quick = np.exp(-(target + now) / (size * scene.rate_hz))
        now = target + quick * (now - target)
        late[:, frame] = now
    seen = np.sqrt(np.maximum(late**2 - dark**2, 0.0))
    return scene.low + scene.span * np.where(away, 1.1 - seen, seen - 0.1)


FORMS = (
    own_resistance_charges,
    median_of_last,
    diode_detector,
    slew_rate,
    peak_detector,
    orifice,
    part_in_gel,
    tracks_place_and_speed,
    photocell,
)
