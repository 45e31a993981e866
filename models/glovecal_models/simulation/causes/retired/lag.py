"""Lag: a sensor's reading follows its signal late by hundredths to tenths of a second, each in its own way.

The memory is fast and belongs to one channel: a capacitor that the sensor itself has to charge, the median
of the last readings, or a rectifier that charges through a diode and discharges through a resistor.
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


FORMS = (own_resistance_charges, median_of_last, diode_detector)
