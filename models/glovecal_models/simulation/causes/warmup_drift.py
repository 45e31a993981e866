"""Warm-up drift: readings move while the electronics warms, minutes after power-on, and then rest.

Times of 1 to 15 minutes are our choice of what small electronics in a cuff shows.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erfcx

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Zero points settle with one time after power-on (first-order thermal model of an amplifier).",
)
def one_exponential(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move towards their end with one time."""
    time_s = draws.one("time_s", 60.0, 400.0)
    return signal - size * draws.signs() * np.exp(-_on(scene) / time_s)[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Zero points and gains settle with a fast and a slow time (chip and housing warm separately).",
)
def offset_and_gain(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points and gains move, with a fast and a slow time."""
    fast = np.exp(-_on(scene) / draws.one("fast_s", 40.0, 120.0))[:, :, None]
    slow = np.exp(-_on(scene) / draws.one("slow_s", 300.0, 900.0))[:, :, None]
    share = draws.each("fast_share", 0.3, 0.7)
    gain = draws.each("gain_share", -1.0, 1.0) * (signal - scene.low) / scene.span
    cold = share * fast + (1 - share) * slow
    return signal - size * draws.signs() * cold * (1 + gain)


@form(
    Stage.ELECTRICAL,
    "Zero points move with the logarithm of the time since power-on (no time of its own; ours).",
)
def logarithm(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Zero points move with the logarithm of the time since power-on and never quite end."""
    start_s = draws.one("start_s", 15.0, 90.0)
    return signal + size * draws.signs() * np.log1p(_on(scene) / start_s)[:, :, None]


def _on(scene: Scene) -> np.ndarray:
    return np.maximum(scene.power_on_s, 0.0)


@form(
    Stage.ELECTRICAL,
    "Zero points settle ever slower as heat soaks into a thick housing (half-space; Carslaw & Jaeger).",
    only_by_name=True,
)
def heat_soaks_in(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What is missing falls with exp(t) erfc(sqrt(t)), whose tail goes with one over the root of time."""
    time_s = draws.each("time_s", 100.0, 400.0)
    since = np.maximum(scene.power_on_s, 0.0)[..., None] / time_s
    return signal + size * 3 * draws.signs() * (erfcx(np.sqrt(since)) - 0.3)


@form(
    Stage.ELECTRICAL,
    "Zero points move away and come back, as the chip warms before its reference does (ours).",
    only_by_name=True,
)
def there_and_back(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The shift rises with time since power-on, has its peak after minutes and dies away."""
    peak_s = draws.each("peak_s", 200.0, 600.0)
    since = np.maximum(scene.power_on_s, 0.0)[..., None] / peak_s
    return signal + size * 3 * draws.signs() * (since * np.exp(1 - since) - 0.5)


@form(
    Stage.ELECTRICAL,
    "The curve's bow in mid-range settles by a hyperbola while both ends stay right (ours).",
    only_by_name=True,
)
def curve_settles(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A parabola over the bend, times one over one plus the time since power-on."""
    time_s = draws.each("time_s", 150.0, 500.0)
    since = np.maximum(scene.power_on_s, 0.0)[..., None] / time_s
    bend = np.clip((signal - scene.low) / scene.span, -0.1, 1.1)
    return signal + size * 3 * draws.signs() * 4 * bend * (1 - bend) * (1 / (1 + since) - 0.4)


FORMS = (
    one_exponential,
    offset_and_gain,
    logarithm,
    heat_soaks_in,
    there_and_back,
    curve_settles,
)
