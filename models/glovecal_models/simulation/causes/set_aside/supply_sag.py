"""Set-aside forms of readings that change with the voltage of the glove's battery."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

CELL_V = 3.7
"""The usual voltage of one lithium cell."""


@form(
    Stage.ELECTRICAL,
    "Charging a sensor to a fixed threshold takes longer at low voltage (logarithm of an RC timer).",
    set_aside=True,
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
    set_aside=True,
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
    set_aside=True,
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


FORMS = (timing_threshold, diode_knee, changes_mode)
