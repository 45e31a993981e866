"""Donning shift: each time the glove is put on, offset and gain of every sensor are a little different.

A random effect: one offset and one gain per wearing, shrunk towards none. A wearing that training never saw
gets none, until a few poses with known angles are taken in it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.effect import Decoy, InstantEffect, Settings, Signals
from glovecal_models.effects.joint_units import in_joint_units, settle_joint_units

PRIOR_DEG = 3.5


class DonningShift(InstantEffect):
    name = "donning_shift"
    explanation = "Putting the glove on again shifts and stretches what its sensors read."
    source = "offset about 3.5 deg from day to day: Gracia-Ibanez 2016; random effect per wearing"
    decoy: ClassVar[Decoy] = "dealt wearings"

    def missing(self, takes: Sequence[Signals]) -> str | None:
        wearings = len({take.wearing for take in takes})
        if wearings < 2:
            return "all takes are of one wearing"
        if wearings == len(takes):
            return "every wearing has only one take; record two in one of them"
        return None

    def lacks(self, settings: Settings, context: Collection[str], wearing: str) -> str | None:
        if wearing in settings["wearings"]:
            return None
        return f"wearing {wearing!r} was not in training" if wearing else "nobody said which wearing this is"

    def settle(self, takes: Sequence[Signals]) -> Settings:
        return {
            "wearings": list(dict.fromkeys(take.wearing for take in takes)),
            **settle_joint_units(takes),
        }

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.zeros((1, takes[0].own.shape[1], 0))

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        wearings = settings["wearings"]
        lanes = take.own.shape[1]
        result = np.zeros((len(take), lanes, 2 * len(wearings)))
        if take.wearing in wearings:
            at = wearings.index(take.wearing)
            result[:, :, at] = 1.0
            result[:, :, len(wearings) + at] = in_joint_units(take.own, settings)
        return result

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.full(2 * len(settings["wearings"]), PRIOR_DEG)

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        wearings = settings["wearings"]
        return (
            *(f"offset_deg[{name}]" for name in wearings),
            *(f"gain_deg_per_sd[{name}]" for name in wearings),
        )
