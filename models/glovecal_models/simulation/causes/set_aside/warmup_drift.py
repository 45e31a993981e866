"""Warm-up drift: readings settle in the minutes after power-on.

The amplifier may set itself to zero now and then, wander less and less, or warm a strip that is stiff when
cold.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "An amplifier sets itself to zero every few minutes and drifts off between (periodic auto-zero).",
    set_aside=True,
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
    set_aside=True,
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
    set_aside=True,
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


FORMS = (auto_zero, wanders_ever_less, stiff_until_warm)
