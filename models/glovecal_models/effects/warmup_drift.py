"""Warm-up: offset and gain change while glove and electronics become warm."""

from __future__ import annotations

import numpy as np

from glovecal_models.effects.base.context_effect import PRIOR_DEG, ContextEffect
from glovecal_models.effects.base.effect import FormSignals
from glovecal_models.effects.base.facts import About, DriftInHolds, Parameter, Shape, Weights
from glovecal_models.effects.base.power_on import POWER_ON, evenly_since_power_on
from glovecal_models.effects.base.relations import CROSSED
from glovecal_models.effects.base.signals import Settings, Signals

TAU_S = (45.0, 75.0, 120.0, 200.0, 330.0, 550.0, 900.0)
SINCE = "logarithm of the time since power-on"
COLDEST = 0.7
"""In time constants: so much earlier than any take of the training the exponential may go on to rise."""


class WarmupDrift(ContextEffect):
    name = "warmup_drift"
    about = About(
        "The reading drifts during the first minutes after the glove is switched on.",
        source="exponential approach to the warm state, 1 to 15 min",
        shown_over="context",
        shows_in=("time since power-on",),
        shown_by=CROSSED,
        in_holds=DriftInHolds("slows down", "warm-up"),
    )
    context = (POWER_ON,)
    shape = Shape((Parameter("tau", "s", 30.0, 1200.0, "1 to 15 min", tried=TAU_S),))
    has_any_form = True

    def evenly(self, value: np.ndarray, settings: Settings) -> np.ndarray:
        return evenly_since_power_on(value)

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        """How cold it still is, and the time itself: the first hardly changes when the glove is warm."""
        since = self.evenly(self.clipped(take, settings), settings)
        time = np.repeat(since[:, None], take.own.shape[1], axis=1)
        return FormSignals({"coldness": columns[:, :, 0], SINCE: time})

    def functions(self, value: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        warm = np.maximum((value[:, None] - settings["low"]) / shape[None, :, 0], -COLDEST)
        return np.exp(-warm)[:, :, None]

    def weights(self, settings: Settings) -> Weights:
        return Weights(("cold_offset_deg", "cold_gain_deg_per_sd"), PRIOR_DEG)
