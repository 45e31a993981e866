"""Cross-coupling: a neighbouring joint pulls at the sensor through the cloth.

Columns are each neighbour and its product with the joint (linear and bilinear, Kahlesz et al. 2004; Wang &
Neff 2013, Table 1). Signals that the base already reads are left out by whoever makes the signals.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.dynamics import InstantEffect
from glovecal_models.effects.base.effect import FormSignals
from glovecal_models.effects.base.facts import About, Weights
from glovecal_models.effects.base.relations import ONE_FINGER
from glovecal_models.effects.base.signals import Settings, Signals, fit_joint_units, in_joint_units

PRIOR_DEG = 3.0
PALM = "PALM_ARCH"
"""Has an effect of its own."""


class CrossCoupling(InstantEffect):
    name = "cross_coupling"
    about = About(
        "Moving a neighbouring joint changes what this sensor reads.",
        source="Wang & Neff 2013, section 3.1 and Table 1; Kahlesz, Zachmann, Klein 2004",
        shown_over="neighbour",
        shows_in=("joint", "sensor"),
        shown_by=ONE_FINGER,
    )
    comparison = EffectComparison("circularly shifted", is_joint_by_joint=True)

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        return None if any(take.others for take in takes) else "no other sensor was recorded"

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        names = list(dict.fromkeys(name for take in takes for name in take.others if name != PALM))
        return {"neighbours": names, **fit_joint_units(takes)}

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        lanes = take.own.shape[1]
        joint = in_joint_units(take.own, settings)[:, :, None]
        names = settings["neighbours"]
        result = np.empty((len(take), lanes, 2 * len(names)))
        for at, name in enumerate(names):
            result[:, :, at] = take.others[name][:, None] if name in take.others else 0.0
        np.multiply(result[:, :, : len(names)], joint, out=result[:, :, len(names) :])
        return result

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        return FormSignals({name: columns[:, :, at] for at, name in enumerate(settings["neighbours"])}, "SD")

    def weights(self, settings: Settings) -> Weights:
        names = settings["neighbours"]
        products = (f"deg_per_sd[{name} x own]" for name in names)
        return Weights((*(f"deg_per_sd[{name}]" for name in names), *products), PRIOR_DEG)
