"""Temperature: a ceramic capacitor past its peak, expansion held by friction, and a fibre's loss in bends."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "A ceramic capacitor sets the gain and peaks at one temperature (diffuse peak; Uchino & Nomura 1982).",
    only_by_name=True,
)
def ceramic_past_its_peak(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A bell of temperature, some degrees wide, times the signal."""
    peak = scene.usual_air[0] + draws.one("peak_c", -1.5, 1.5)
    away = (scene.temperature_c - peak) / draws.one("wide_c", 1.2, 2.5)
    fallen = 1 / (1 + away**2) - 0.5
    return signal + size * 10 * fallen[:, :, None] * (0.3 + (signal - scene.low) / scene.span)


@form(
    Stage.ELECTRICAL,
    "A clamped strip expands against friction and stays behind the temperature both ways (Coulomb; play).",
    only_by_name=True,
)
def expands_against_friction(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Free travel of half a degree to a degree Celsius; the state lasts from take to take."""
    held = draws.one("held_c", 0.5, 1.0)
    warm = scene.temperature_c.ravel()
    order = np.argsort(scene.session_s.ravel(), kind="stable")
    behind, state = np.empty(warm.size), float(warm[order[0]])
    for moment, now in zip(order.tolist(), warm[order].tolist(), strict=True):
        state = min(max(state, now - held), now + held)
        behind[moment] = state
    follows = behind.reshape(scene.temperature_c.shape) - scene.usual_air[0]
    return signal + size * draws.signs() * follows[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Warmth changes the exponent of a fibre's loss in bends, as its index falls (Marcuse 1976; ours).",
    only_by_name=True,
)
def fibre_loss_exponent(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The loss is exponential in bend times index step, so warmth matters far more in deep bends."""
    exponent, per_c = draws.each("exponent", 2.5, 4.5), draws.one("per_c", 0.02, 0.05)
    warmer = np.clip(per_c * (scene.temperature_c - scene.usual_air[0]), -0.5, 0.5)[:, :, None]
    bend = exponent * np.clip((signal - scene.low) / scene.span, 0.0, 1.1)
    loss = (np.exp(bend * (1 + warmer)) - np.exp(bend)) * np.exp(-exponent)
    return signal + size * draws.sign() * 20 * loss


FORMS = (ceramic_past_its_peak, expands_against_friction, fibre_loss_exponent)
