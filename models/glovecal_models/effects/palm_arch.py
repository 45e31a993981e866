"""Palm arch: hollowing the palm moves thumb and little finger, and pulls at their sensors.

Linear terms of the palm-arch sensor and of the thumb's roll and abduction, as in Krnoul et al. 2016: the
little finger's metacarpal follows the palm sensor (equation 2) and hands 75 % of it to its flexion (3), the
thumb's abduction (4) gets a gain of the palm sensor added (5). Gains are learned here, 75 % included; a
square of the palm sensor follows the hollow where it is a cylinder's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.dynamics import InstantEffect
from glovecal_models.effects.base.effect import FormSignals
from glovecal_models.effects.base.facts import About, Weights
from glovecal_models.effects.base.relations import CUPPED_PALM, LackOfMotion
from glovecal_models.effects.base.signals import Settings, Signals

PALM = "PALM_ARCH"
SIGNALS = (PALM, "T_TMC", "TI_ABD")


class PalmArch(InstantEffect):
    name = "palm_arch"
    about = About(
        "Hollowing the palm pulls at this sensor, most of all at thumb and little finger.",
        source="Krnoul, Kanis, Zelezny, Muller 2016, section 3.3.3, equations 2 to 5",
        shown_over="neighbour",
        neighbours=(PALM,),
        shows_in=(f"sensor {PALM}", f"joint {PALM}"),
        shown_by=CUPPED_PALM,
    )
    comparison = EffectComparison("circularly shifted", is_joint_by_joint=True)

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        known = [take.others[PALM] for take in takes if PALM in take.others]
        if not known:
            return f"no palm arch sensor ({PALM}) is among the other signals"
        if np.ptp(np.concatenate(known)) <= 1e-6:
            return LackOfMotion(f"the palm arch sensor ({PALM}) never moves", CUPPED_PALM)
        return None

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        ranges: dict[str, list[float]] = {}
        for name in SIGNALS:
            known = [take.others[name] for take in takes if name in take.others]
            if known:
                values = np.concatenate(known)
                ranges[name] = [float(values.min()), float(values.max())]
        return {"signals": ranges}

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        rest = np.zeros(len(take))
        result = np.empty((len(take), take.own.shape[1], 1 + len(settings["signals"])))
        for column, (name, (low, high)) in enumerate(settings["signals"].items()):
            result[:, :, column] = np.clip(take.others.get(name, rest), low, high)[:, None]
        result[:, :, -1] = result[:, :, list(settings["signals"]).index(PALM)] ** 2
        return result

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        return FormSignals({name: columns[:, :, at] for at, name in enumerate(settings["signals"])}, "SD")

    def weights(self, settings: Settings) -> Weights:
        return Weights((*(f"deg_per_sd[{name}]" for name in settings["signals"]), f"deg_per_sd2[{PALM}]"))
