"""Supply sag: the readings scale with the battery's voltage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.context_effect import ContextEffect
from glovecal_models.effects.effect import Parameter, Settings, Signals

EXPONENTS = (1.0,)


class SupplySag(ContextEffect):
    name = "supply_sag"
    explanation = "All readings shrink together as the supply voltage falls."
    source = "reading x (V / V0)^n; offset and gain of each joint follow"
    parameters: ClassVar = (Parameter("exponent", "1", 0.3, 3.0, "about 1"),)
    context: ClassVar = ("supply_v",)

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.repeat(np.array(EXPONENTS)[:, None, None], takes[0].own.shape[1], axis=1)

    def functions(self, value: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        ratio = np.maximum(value, 1e-6) / max(settings["usual"], 1e-6)
        return (ratio[:, None] ** -shape[None, :, 0] - 1.0)[:, :, None]

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        return ("offset_deg", "gain_deg_per_sd")
