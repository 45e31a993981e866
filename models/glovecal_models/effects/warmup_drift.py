"""Warm-up: offset and gain change while glove and electronics become warm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.context_effect import PRIOR_DEG, ContextEffect
from glovecal_models.effects.base.facts import Parameter, Rival, Settings
from glovecal_models.effects.base.motions import CROSSED
from glovecal_models.effects.base.signals import Signals

TAU_S = (45.0, 75.0, 120.0, 200.0, 330.0, 550.0, 900.0)
SINCE = "logarithm of the time since power-on"
SOON_S = 30.0
"""After power-on: before that a second counts as much as any other."""
COLDEST = 0.7
"""In time constants: so much earlier than any take of the training the exponential may go on to rise."""


class WarmupDrift(ContextEffect):
    name = "warmup_drift"
    explanation = "The reading drifts during the first minutes after the glove is switched on."
    source = "exponential approach to the warm state, 1 to 15 min"
    shown_by: ClassVar = CROSSED
    shows_in: ClassVar = ("time since power-on",)
    rivals: ClassVar = tuple(Rival(name, CROSSED) for name in ("temperature", "humidity", "supply_sag"))
    plain_name = "warm-up"
    drift_in_holds: ClassVar = "slows down"
    parameters: ClassVar = (Parameter("tau", "s", 30.0, 1200.0, "1 to 15 min"),)
    context: ClassVar = ("power_on_s",)
    has_any_form: ClassVar[bool] = True

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.repeat(np.array(TAU_S)[:, None, None], takes[0].own.shape[1], axis=1)

    def evenly(self, value: np.ndarray, settings: Settings) -> np.ndarray:
        return np.log(np.maximum(value, 0.0) + SOON_S)

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> Mapping[str, np.ndarray]:
        """How cold it still is, and the time itself: the first hardly changes when the glove is warm."""
        since = self.evenly(self.clipped(take, settings), settings)
        return {"coldness": columns[:, :, 0], SINCE: np.repeat(since[:, None], take.own.shape[1], axis=1)}

    def functions(self, value: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        warm = np.maximum((value[:, None] - settings["low"]) / shape[None, :, 0], -COLDEST)
        return np.exp(-warm)[:, :, None]

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.full(2, PRIOR_DEG)

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        return ("cold_offset_deg", "cold_gain_deg_per_sd")
