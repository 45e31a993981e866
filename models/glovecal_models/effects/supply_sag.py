"""Supply sag: the readings scale with the battery's voltage, all about a reading of zero."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.column_steps import step_columns, step_names, step_prior_sd
from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.facts import Parameter, Settings
from glovecal_models.effects.base.joint_units import in_joint_units
from glovecal_models.effects.base.motions import CROSSED
from glovecal_models.effects.base.signals import Signals

EXPONENTS = (1.0, 2.0)
OWN_PRIOR_DEG = 1.0
"""How far a joint may depart from the common scaling, for the whole fall of the voltage."""


class SupplySag(ContextEffect):
    """Columns: the common scaling, then each joint's own departure from it in offset and gain.

    Two more where it acts in steps.
    """

    name = "supply_sag"
    explanation = "All readings shrink together as the supply voltage falls."
    source = "reading x (V / V0)^n, n about 1; small departures for each joint"
    shown_by: ClassVar = CROSSED
    parameters: ClassVar = (Parameter("exponent", "1", 0.3, 3.0, "about 1"),)
    context: ClassVar = ("supply_v",)
    has_any_form: ClassVar[bool] = True
    may_act_in_steps: ClassVar[bool] = True

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.repeat(np.array(EXPONENTS)[:, None, None], takes[0].own.shape[1], axis=1)

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        volts = self.clipped(take, settings)
        loss = (volts[:, None] / max(settings["usual"], 1e-6)) ** -shape[None, :, 0] - 1.0
        zero = np.resize(0.0 if take.zero_deg is None else take.zero_deg, take.own.shape[1])
        common = (take.own - zero) * loss
        own = (volts / max(settings["high"] - settings["low"], 1e-9))[:, None] * np.ones_like(take.own)
        own = own - settings["usual"] / max(settings["high"] - settings["low"], 1e-9)
        joint = in_joint_units(take.own, settings)
        smooth = np.stack([common, own, own * joint, own * joint**2], axis=2)
        return np.concatenate([smooth, step_columns(volts, take.own, settings)], axis=2)

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.append([1.0, OWN_PRIOR_DEG, OWN_PRIOR_DEG, OWN_PRIOR_DEG], step_prior_sd(settings))

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        return (
            "common_scaling_deg_per_deg",
            "own_offset_deg",
            "own_gain_deg_per_sd",
            "own_bend_deg_per_sd2",
            *step_names(settings, self.column),
        )
