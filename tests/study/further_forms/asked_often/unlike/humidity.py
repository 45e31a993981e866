"""Humidity: fibres that keep water while drying, padding that swells below mid-bend, and heat of sorption."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.ELECTRICAL,
    "Fibres hold more water drying than wetting, however slowly (sorption hysteresis; Urquhart 1929).",
    only_by_name=True,
)
def fibres_keep_water(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The water stays behind the humidity by a fixed width both ways; the state lasts from take to take."""
    wide = draws.one("wide_pct", 0.8, 1.8)
    damp = scene.humidity_pct.ravel()
    order = np.argsort(scene.session_s.ravel(), kind="stable")
    behind, state = np.empty(damp.size), float(damp[order[0]])
    for moment, now in zip(order.tolist(), damp[order].tolist(), strict=True):
        state = min(max(state, now - wide), now + wide)
        behind[moment] = state
    water = behind.reshape(scene.humidity_pct.shape) - scene.usual_air[1]
    return signal + size * draws.signs() * water[:, :, None]


@form(
    Stage.ELECTRICAL,
    "Padding swells with humidity and lifts the strip in mid-bend, where it spans the knuckle freely (ours).",
    only_by_name=True,
)
def padding_swells_under_span(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to humidity times a bow over the bend: both ends lie on bone."""
    share = np.clip((signal - scene.low) / scene.span, 0.0, 1.0)
    damper = (scene.humidity_pct - scene.usual_air[1])[:, :, None]
    return signal + size * draws.sign() * damper * 4 * share * (1 - share)


@form(
    Stage.ELECTRICAL,
    "Fibres warm while they take up water and cool while they dry (Cassie, King & Baxter 1940).",
    only_by_name=True,
)
def heat_of_sorption(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """How far the humidity has left its own mean of the last one to three minutes behind."""
    lasts = draws.one("lasts_s", 60.0, 180.0)
    moments, first = np.unique(scene.session_s.ravel(), return_index=True)
    seconds = np.arange(moments[0], moments[-1] + 1.0)
    damp = np.interp(seconds, moments, scene.humidity_pct.ravel()[first])
    keep = np.exp(-1 / lasts)
    taken_up = lfilter([1 - keep], [1.0, -keep], damp - damp[0]) + damp[0]
    warm = np.interp(scene.session_s, seconds, damp - taken_up)
    return signal + size * draws.signs() * 2 * warm[:, :, None]


FORMS = (fibres_keep_water, padding_swells_under_span, heat_of_sorption)
