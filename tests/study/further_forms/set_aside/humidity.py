"""Set-aside forms of humidity."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Cotton takes up water along a bent isotherm and swells across, which tightens the sleeves (GAB "
    "isotherm, Anderson 1946; Morton and Hearle 2008).",
    set_aside=True,
)
def sleeves_swell(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """An offset along the sorption isotherm."""
    binding, layers = draws.one("binding", 6.0, 14.0), draws.one("layers", 0.7, 0.85)

    def regain(humidity: np.ndarray | float) -> np.ndarray | float:
        wet = layers * np.clip(humidity, 0.0, 100.0) / 100.0
        return binding * wet / ((1.0 - wet) * (1.0 + (binding - 1.0) * wet))

    usual = scene.usual_air[1]
    per_percent = regain(usual + 0.5) - regain(usual - 0.5)
    change = (regain(scene.humidity_pct) - regain(usual)) / per_percent
    return signal + size * draws.signs() * 0.7 * change[:, :, None]


@form(
    Stage.ELECTRICAL,
    "A film of water on the board shunts sensors of high resistance, with a leak that grows "
    "exponentially with the humidity (surface conduction of insulators, Curtis 1915).",
    set_aside=True,
)
def board_leaks(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The more resistance the strip has, which is the more it is bent, the more is lost."""
    per_percent, power = draws.each("per_percent", 0.06, 0.2), draws.each("power", 1.0, 2.0)
    leak = np.exp(np.minimum(per_percent * (scene.humidity_pct[:, :, None] - scene.usual_air[1]), 4.0))
    bent = np.clip((signal - scene.low) / scene.span, 0.0, 1.2)
    return signal - size * 6.0 * leak * (0.2 + bent**power)


@form(
    Stage.ELECTRICAL,
    "The glove's fibres follow the moisture of the air only after minutes, sooner when they take it "
    "up than when they give it off (Henry 1939 on diffusion in textiles).",
    set_aside=True,
)
def fibres_follow_late(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A stretch and an offset with moisture that remembers the takes before."""
    takes_up, gives_off = draws.one("takes_up_s", 60.0, 200.0), draws.one("gives_off_s", 200.0, 500.0)
    clock, air = scene.session_s.ravel(), scene.humidity_pct.ravel()
    order = np.argsort(clock, kind="stable")
    grid = np.arange(clock.min(), clock.max() + 1.0)
    outside = np.interp(grid, clock[order], air[order])
    inside = np.empty_like(grid)
    state = outside[0]
    for n, wet in enumerate(outside):
        state += (wet - state) / (takes_up if wet > state else gives_off)
        inside[n] = state
    moisture = np.interp(scene.session_s, grid, inside)[:, :, None] - scene.usual_air[1]
    stretch = draws.each("stretch", -0.8, 0.8) * (signal - scene.low) / scene.span
    return signal + size * 0.7 * moisture * (draws.signs() + stretch)


FORMS: tuple[Form, ...] = (sleeves_swell, board_leaks, fibres_follow_late)
