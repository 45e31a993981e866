"""Supply sag: readings follow the supply voltage, whatever the hand does and however long it has been on.

Firmware corrects for a battery it measures coarsely, headroom shrinks, and a bias starves near the cut-off.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.COUNTS,
    "Firmware corrects the gain by the voltage in coarse steps: a sawtooth of the voltage stays (ours).",
    set_aside=True,
    sizes=(0.003, 20.0),
    shared=True,
)
def coarsely_corrected(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Raw counts are off by what lies between the voltage and the step it was rounded to."""
    step_v = draws.one("step_v", 0.04, 0.09)
    steps = scene.supply_v / step_v + draws.one("edge", 0.0, 1.0)
    missed = (steps - np.round(steps))[:, :, None]
    return signal + size * 0.05 * missed * (signal + scene.counts_zero_deg)


@form(
    Stage.ELECTRICAL,
    "An amplifier's headroom falls with the voltage, so that bent joints read lower.",
    set_aside=True,
)
def headroom_shrinks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What exceeds a soft limit is lost in part, and the limit falls with the voltage."""
    limit = draws.each("limit", 0.4, 0.55) + draws.one("per_volt", 2.0, 4.0) * (
        scene.supply_v[:, :, None] - 4.0
    )
    soft = draws.one("soft", 0.04, 0.1)
    over = ((signal - scene.low) / scene.span - limit) / soft
    return signal - size * 10 * soft * np.logaddexp(0, over)


@form(
    Stage.ELECTRICAL,
    "A bias current starves exponentially near the cut-off, and the curve sags in mid-range (ours).",
    set_aside=True,
)
def bias_starves(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A bow over the bend, right at both ends, that deepens exponentially as the voltage falls."""
    starved = np.exp((4.0 - scene.supply_v[:, :, None]) / draws.one("scale_v", 0.03, 0.08))
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    return signal - size * 4 * bend * (1 - bend) * (starved - 1)


FORMS = (coarsely_corrected, headroom_shrinks, bias_starves)
