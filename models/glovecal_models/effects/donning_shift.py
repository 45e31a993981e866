"""Donning shift: each time the glove is put on, offset and gain of every sensor are a little different.

A random effect: one offset and one gain per wearing, shrunk towards none, and where the takes ask for it a
smooth curve along the bend (``WearingCurves``). A wearing that training never saw gets none, and an
interval as wide as wearings differ, until a quick check takes a few poses with known angles in it
(quick_check/): it tells offset and gain.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.effect import FurtherColumns
from glovecal_models.effects.base.facts import About, Certainty, Weights
from glovecal_models.effects.base.relations import CROSSED
from glovecal_models.effects.base.signals import Settings, Signals, fit_joint_units, in_joint_units
from glovecal_models.effects.base.wearing_effect import (
    CURVES,
    PRIOR_DEG,
    WearingCurves,
    WearingEffect,
    WeightsOfShifts,
    curves_over,
    possible_curves,
)


class FurtherCurves(FurtherColumns):
    """A curve for each wearing along the bend."""

    def choices(self, takes: Sequence[Signals], settings: Settings) -> list[Settings]:
        return [{**settings, CURVES: curves} for curves in possible_curves(takes, settings["wearings"])]

    def as_stored(self, takes: Sequence[Signals], settings: Settings, stored: Settings) -> Settings:
        curves, wearings = WearingCurves.of_settings(stored), settings["wearings"]
        if curves is None or len(wearings) < 2:
            return settings
        return {**settings, CURVES: curves_over(curves.form.terms, takes, wearings)}

    def described(self, names: Sequence[str], settings: Settings, weights: np.ndarray) -> dict[str, float]:
        """Offsets and gains, and how large each curve is: its weights say nothing to a reader."""
        curves, own = WearingCurves.of_settings(settings), 2 * len(settings["wearings"])
        numbers = super().described(names[:own], settings, weights[:own])
        if curves is None:
            return numbers
        sizes = curves.size_deg(weights[None, own:])[0]
        named = zip(curves.wearings, map(float, sizes), strict=True)
        return numbers | {f"curve_rms_deg[{name}]": size for name, size in named}


class DonningShift(WearingEffect):
    name = "donning_shift"
    about = About(
        "Putting the glove on again shifts and stretches what its sensors read.",
        source="offset about 3.5 deg from day to day: Gracia-Ibanez 2016; random effect per wearing",
        shown_over="wearing",
        shows_in=("wearing",),
        shown_by=CROSSED,
    )
    comparison = EffectComparison(
        "permuted wearings",
        certainty=Certainty(
            clear=0.04,
            faint=0.01,
            of_few_takes=1.0,
            why="there is one column of wearings, but context columns have many names",
        ),
    )
    further = FurtherCurves()

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        wearings = len({take.wearing for take in takes})
        if wearings < 2:
            return "all takes are of one wearing"
        if wearings == len(takes):
            return "every wearing has only one take; record two in one of them"
        return None

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        return {"wearings": list(dict.fromkeys(take.wearing for take in takes)), **fit_joint_units(takes)}

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

    def weights(self, settings: Settings) -> Weights:
        wearings, curves = settings["wearings"], WearingCurves.of_settings(settings)
        count = curves.count if curves else 0
        return Weights(
            (
                *(f"offset_deg[{name}]" for name in wearings),
                *(f"gain_deg_per_sd[{name}]" for name in wearings),
                *(f"curve[{number}]" for number in range(count)),
            ),
            np.append(np.full(2 * len(wearings), PRIOR_DEG), np.ones(count)),
            WeightsOfShifts(settings),
        )
