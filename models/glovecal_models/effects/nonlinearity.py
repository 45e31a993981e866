"""Nonlinearity: the reading is not proportional to the angle.

Columns are Legendre polynomials of the joint's own signal, scaled to the range seen in training and held at
its ends outside. Constant and slope are left out: the base has them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.dynamics import InstantEffect
from glovecal_models.effects.base.effect import FormSignals
from glovecal_models.effects.base.facts import BETWEEN_TAKES, About, Weights
from glovecal_models.effects.base.learned_form import OWN
from glovecal_models.effects.base.relations import RAMPS, LackOfMotion
from glovecal_models.effects.base.signals import Settings, Signals, on_lanes

DEGREES = (2, 3, 4, 5, 6, 7)
PRIOR_DEG = 20.0
"""Over the degree: higher ones are smaller."""
LEAST_RANGE_DEG = 5.0
"""A joint that moves less shows no curve."""


class Nonlinearity(InstantEffect):
    name = "nonlinearity"
    about = About(
        "The sensor is not proportional: the same movement reads differently in another posture.",
        source="smooth curve of the joint; bend sensors are curved: Kahlesz, Zachmann, Klein 2004",
        shows_in=("angle",),
        shown_by=RAMPS,
    )
    comparison = EffectComparison(
        "circularly shifted", certainty=replace(BETWEEN_TAKES, of_few_takes=1.0, why="every sensor bends")
    )

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        if not takes:
            return "there are no takes"
        low, high = _range(takes)
        widest = float(np.max(high - low))
        if widest >= LEAST_RANGE_DEG:
            return None
        why = f"no joint moves more than {widest:.1f} deg; a curve shows from {LEAST_RANGE_DEG:g} deg on"
        return LackOfMotion(why, RAMPS)

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        low, high = _range(takes)
        return {"own_low_deg": low.tolist(), "own_high_deg": high.tolist()}

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        lanes = take.own.shape[1]
        low, high = on_lanes(settings["own_low_deg"], lanes), on_lanes(settings["own_high_deg"], lanes)
        place = np.clip(2.0 * (take.own - low) / np.maximum(high - low, 1e-6) - 1.0, -1.0, 1.0)
        return _legendre(place)

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        return FormSignals({OWN: take.own})

    def weights(self, settings: Settings) -> Weights:
        names = tuple(f"legendre_{degree}_deg" for degree in DEGREES)
        return Weights(names, PRIOR_DEG / np.array(DEGREES, dtype=float))


def _range(takes: Sequence[Signals]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest angle of each lane, degrees, (L,) each."""
    return (
        np.min([take.own.min(axis=0) for take in takes], axis=0),
        np.max([take.own.max(axis=0) for take in takes], axis=0),
    )


def _legendre(x: np.ndarray) -> np.ndarray:
    """(N, L, len(DEGREES)) by Bonnet's recursion; x (N, L) within -1 and 1."""
    values = [np.ones_like(x), x]
    for degree in range(1, DEGREES[-1]):
        values.append(((2 * degree + 1) * x * values[-1] - degree * values[-2]) / (degree + 1))
    return np.stack([values[degree] for degree in DEGREES], axis=2)
