"""Supply sag: as the battery empties, all readings shrink together.

A bend sensor is half of a voltage divider: without a reference that follows the supply its counts do. The
whole glove shares one law.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

FULL_V = 4.1


@form(
    Stage.COUNTS,
    "Raw counts go with a power of the supply voltage (voltage divider without its own reference).",
    sizes=(0.003, 20.0),
    shared=True,
)
def gain_power(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Counts go with a power of the voltage; the size is the power."""
    return _scaled(signal, scene, (scene.supply_v / FULL_V) ** size[0])


@form(
    Stage.ELECTRICAL,
    "Zero points and gains change in a straight line with the supply voltage (finite supply rejection).",
)
def offset_and_gain(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points and gains go in a straight line with the voltage, each sensor a little differently."""
    missing = (scene.supply_v - FULL_V)[:, :, None]
    bent = (signal - scene.low) / scene.span
    slope = draws.sign() * (draws.each("zero_deg_per_volt", 0.5, 1.5) + draws.one("gain", 0.5, 1.5) * bent)
    return signal + size * slope * missing


@form(
    Stage.COUNTS,
    "Raw counts fall with the voltage below the regulator's limit, not above (low-dropout regulator).",
    sizes=(0.003, 20.0),
    shared=True,
)
def regulator_dropout(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing happens until the battery is too low for the regulator; from there counts fall with it."""
    limit = draws.one("limit_v", 3.98, 4.05)
    return _scaled(signal, scene, 1 - size[0] * np.maximum(limit - scene.supply_v, 0.0) / limit)


def _scaled(signal: np.ndarray, scene: Scene, share: np.ndarray) -> np.ndarray:
    return (scene.counts_zero_deg + signal) * share[:, :, None] - scene.counts_zero_deg


CELL_V = 3.7


"""The usual voltage of one lithium cell."""


@form(
    Stage.ELECTRICAL,
    "Charging a sensor to a fixed threshold takes longer at low voltage (logarithm of an RC timer).",
    only_by_name=True,
)
def timing_threshold(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The time to reach the threshold stretches the reading, also what is there when straight."""
    threshold_v = draws.each("threshold_v", 1.8, 2.8)
    straight = draws.each("straight", 0.1, 0.6)
    bend = (signal - scene.low) / scene.span
    supply = np.maximum(scene.supply_v[..., None], threshold_v + 0.1)
    longer = np.log(supply / (supply - threshold_v)) - np.log(CELL_V / (CELL_V - threshold_v))
    return signal + size * 8 * (straight + bend) * longer


@form(
    Stage.ELECTRICAL,
    "A fibre's light dims as the voltage nears its diode's knee, most while the fibre is straight (ours).",
    only_by_name=True,
)
def diode_knee(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Light grows evenly above a rounded knee of the voltage and falls exponentially with the bend."""
    knee_v = draws.each("knee_v", 3.2, 3.8)
    round_v = draws.each("round_v", 0.08, 0.2)
    lost = draws.each("lost", 0.8, 2.0)
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.3)
    light = round_v * (
        np.logaddexp(0.0, (scene.supply_v[..., None] - knee_v) / round_v)
        - np.logaddexp(0.0, (CELL_V - knee_v) / round_v)
    )
    return signal - size * 8 * light * np.exp(-lost * bend)


@form(
    Stage.ELECTRICAL,
    "A buck-boost converter puts out another voltage on either side of where it changes mode (ours).",
    only_by_name=True,
)
def changes_mode(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points and gains go from one level to another around one supply voltage of the whole glove."""
    changes_v = draws.one("changes_v", 3.6, 3.95)
    width_v = draws.one("width_v", 0.06, 0.2)
    zero = draws.each("zero", 0.4, 1.0) * draws.signs()
    gain = draws.each("gain", -1.0, 1.0)
    bend = (signal - scene.low) / scene.span
    mode = np.tanh((scene.supply_v[..., None] - changes_v) / width_v)
    return signal + size * 2 * (zero + gain * bend) * mode


FORMS = (
    gain_power,
    offset_and_gain,
    regulator_dropout,
    timing_threshold,
    diode_knee,
    changes_mode,
)
