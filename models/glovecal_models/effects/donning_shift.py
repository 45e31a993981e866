"""Donning shift: each time the glove is put on, offset and gain of every sensor are a little different.

A random effect: one offset and one gain per wearing, shrunk towards none, and where the takes ask for it a
smooth curve along the bend (base/wearing_curves.py). A wearing that training never saw gets none, and an
interval as wide as wearings differ, until a quick check takes a few poses with known angles in it
(quick_check/): it tells offset and gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.facts import Certainty, Control, Rival, Settings
from glovecal_models.effects.base.joint_units import fit_joint_units, in_joint_units
from glovecal_models.effects.base.motions import CROSSED
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.base.wearing_curves import CURVES, WearingCurves, curves_over, possible_curves
from glovecal_models.effects.base.wearing_effect import PRIOR_DEG, WearingEffect


class DonningShift(WearingEffect):
    name = "donning_shift"
    explanation = "Putting the glove on again shifts and stretches what its sensors read."
    source = "offset about 3.5 deg from day to day: Gracia-Ibanez 2016; random effect per wearing"
    shown_by: ClassVar = CROSSED
    shows_in: ClassVar = ("wearing",)
    shown_over: ClassVar = "wearing"
    rivals: ClassVar = tuple(
        Rival(name, CROSSED) for name in ("warmup_drift", "temperature", "humidity", "supply_sag")
    )
    certainty: ClassVar = Certainty(
        clear=0.04, faint=0.01, why="there is one column of wearings, but context columns have many names"
    )
    control: ClassVar[Control] = "permuted wearings"

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        wearings = len({take.wearing for take in takes})
        if wearings < 2:
            return "all takes are of one wearing"
        if wearings == len(takes):
            return "every wearing has only one take; record two in one of them"
        return None

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        return {
            "wearings": list(dict.fromkeys(take.wearing for take in takes)),
            **fit_joint_units(takes),
        }

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.zeros((1, takes[0].own.shape[1], 0))

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        wearings, curves = settings["wearings"], WearingCurves.of_settings(settings)
        lanes = take.own.shape[1]
        result = np.zeros((len(take), lanes, 2 * len(wearings) + (curves.count if curves else 0)))
        if take.wearing in wearings:
            at = wearings.index(take.wearing)
            result[:, :, at] = 1.0
            result[:, :, len(wearings) + at] = in_joint_units(take.own, settings)
        if curves:
            result[:, :, 2 * len(wearings) :] = curves.columns(take.own, take.wearing)
        return result

    def settings_with_curves(self, takes: Sequence[Signals], settings: Settings) -> list[Settings]:
        return [{**settings, CURVES: curves} for curves in possible_curves(takes, settings["wearings"])]

    def settings_as_stored(self, takes: Sequence[Signals], settings: Settings, stored: Settings) -> Settings:
        curves, wearings = WearingCurves.of_settings(stored), settings["wearings"]
        if curves is None or len(wearings) < 2:
            return settings
        return {**settings, CURVES: curves_over(curves.form.terms, takes, wearings)}

    def prior_sd(self, settings: Settings) -> np.ndarray:
        curves = WearingCurves.of_settings(settings)
        own = np.full(2 * len(settings["wearings"]), PRIOR_DEG)
        return np.append(own, np.ones(curves.count)) if curves else own

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        wearings, curves = settings["wearings"], WearingCurves.of_settings(settings)
        return (
            *(f"offset_deg[{name}]" for name in wearings),
            *(f"gain_deg_per_sd[{name}]" for name in wearings),
            *(f"curve[{number}]" for number in range(curves.count if curves else 0)),
        )

    def described(self, settings: Settings, shape: np.ndarray, weights: np.ndarray) -> dict[str, float]:
        """Offsets and gains, and how large each curve is: its weights say nothing to a reader."""
        curves, own = WearingCurves.of_settings(settings), 2 * len(settings["wearings"])
        numbers = dict(zip(self.weight_names(settings)[:own], map(float, weights[:own]), strict=True))
        if curves is None:
            return numbers
        sizes = curves.size_deg(weights[None, own:])[0]
        named = zip(curves.wearings, map(float, sizes), strict=True)
        return numbers | {f"curve_rms_deg[{name}]": size for name, size in named}
