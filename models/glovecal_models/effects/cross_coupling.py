"""Cross-coupling: a neighbouring joint pulls at the sensor through the cloth.

Columns are each neighbour and its product with the joint (linear and bilinear, Kahlesz et al. 2004; Wang &
Neff 2013, Table 1). Signals that the base already reads are left out by whoever makes the signals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.effect import InstantEffect
from glovecal_models.effects.base.facts import Control, Rival, Settings
from glovecal_models.effects.base.joint_units import fit_joint_units, in_joint_units
from glovecal_models.effects.base.motions import CUPPED_PALM, ONE_FINGER
from glovecal_models.effects.base.signals import Signals

PRIOR_DEG = 3.0
PALM = "PALM_ARCH"
"""Has an effect of its own."""


class CrossCoupling(InstantEffect):
    name = "cross_coupling"
    explanation = "Moving a neighbouring joint changes what this sensor reads."
    source = "Wang & Neff 2013, section 3.1 and Table 1; Kahlesz, Zachmann, Klein 2004"
    form_unit: ClassVar[str] = "SD"
    one_joint_at_a_time: ClassVar[bool] = True
    shows_in: ClassVar = ("joint", "sensor")
    shown_over: ClassVar = "neighbour"
    shown_by: ClassVar = ONE_FINGER
    rivals: ClassVar = (Rival("palm_arch", CUPPED_PALM), Rival("contact_pressure", ONE_FINGER))
    caveat = "a common cause that was not recorded, such as grip pressure or a strap, looks the same"
    control: ClassVar[Control] = "circularly shifted"

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        return None if any(take.others for take in takes) else "no other sensor was recorded"

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        names = list(dict.fromkeys(name for take in takes for name in take.others if name != PALM))
        return {
            "neighbours": names,
            **fit_joint_units(takes),
        }

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.zeros((1, takes[0].own.shape[1], 0))

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        lanes = take.own.shape[1]
        joint = in_joint_units(take.own, settings)[:, :, None]
        names = settings["neighbours"]
        result = np.empty((len(take), lanes, 2 * len(names)))
        for at, name in enumerate(names):
            result[:, :, at] = take.others[name][:, None] if name in take.others else 0.0
        np.multiply(result[:, :, : len(names)], joint, out=result[:, :, len(names) :])
        return result

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> Mapping[str, np.ndarray]:
        return {name: columns[:, :, at] for at, name in enumerate(settings["neighbours"])}

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.full(2 * len(settings["neighbours"]), PRIOR_DEG)

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        names = settings["neighbours"]
        return (*(f"deg_per_sd[{name}]" for name in names), *(f"deg_per_sd[{name} x own]" for name in names))
