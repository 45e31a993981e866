"""Set-aside forms of electronics that settle after they are switched on."""

from __future__ import annotations

import numpy as np
from scipy.special import erfcx

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Zero points settle ever slower as heat soaks into a thick housing (half-space; Carslaw & Jaeger).",
    set_aside=True,
)
def heat_soaks_in(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What is missing falls with exp(t) erfc(sqrt(t)), whose tail goes with one over the root of time."""
    time_s = draws.each("time_s", 100.0, 400.0)
    since = np.maximum(scene.power_on_s, 0.0)[..., None] / time_s
    return signal + size * 3 * draws.signs() * (erfcx(np.sqrt(since)) - 0.3)


@form(
    Stage.ELECTRICAL,
    "Zero points move away and come back, as the chip warms before its reference does (ours).",
    set_aside=True,
)
def there_and_back(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The shift rises with time since power-on, has its peak after minutes and dies away."""
    peak_s = draws.each("peak_s", 200.0, 600.0)
    since = np.maximum(scene.power_on_s, 0.0)[..., None] / peak_s
    return signal + size * 3 * draws.signs() * (since * np.exp(1 - since) - 0.5)


@form(
    Stage.ELECTRICAL,
    "The curve's bow in mid-range settles by a hyperbola while both ends stay right (ours).",
    set_aside=True,
)
def curve_settles(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A parabola over the bend, times one over one plus the time since power-on."""
    time_s = draws.each("time_s", 150.0, 500.0)
    since = np.maximum(scene.power_on_s, 0.0)[..., None] / time_s
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.1)
    return signal + size * 3 * draws.signs() * 4 * bend * (1 - bend) * (1 / (1 + since) - 0.4)


FORMS = (heat_soaks_in, there_and_back, curve_settles)
