"""Whether an effect makes the claimed standard deviation truer, on takes it has not learned from either."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.interval_effect import IntervalEffect, LeftOutErrors
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits

PARTS = 3


@dataclass(frozen=True)
class Claim:
    """How true claimed standard deviations are."""

    nlpd: float
    """Mean negative log predictive density, nats."""
    coverage: float
    """Share of measurements within one claimed standard deviation; 0.68 is truthful."""
    coverage_95: float
    """Share within 1.96 of them; 0.95 is truthful."""


@dataclass(frozen=True)
class ClaimCheck:
    """Before and after."""

    before: Claim
    after: Claim
    limits: ImprovementLimits = IMPROVEMENT_LIMITS

    @property
    def is_truer(self) -> bool:
        return self.before.nlpd - self.after.nlpd >= self.limits.claim_least_fall_nats

    @property
    def is_no_worse(self) -> bool:
        return self.after.nlpd - self.before.nlpd <= self.limits.claim_most_rise_nats

    def to_document(self) -> dict[str, float]:
        """Plain JSON-able data."""
        return {
            f"{name}_{when}": value
            for when, claim in (("before", self.before), ("after", self.after))
            for name, value in asdict(claim).items()
        }


def check_claim(
    effect: IntervalEffect,
    left_out: Sequence[LeftOutErrors],
    found: Settings,
    limits: ImprovementLimits = IMPROVEMENT_LIMITS,
) -> ClaimCheck:
    """Learn from two thirds of the takes, judge on the rest, in turns."""
    names = list(dict.fromkeys(item.take for item in left_out))
    error, before, after = [], [], []
    for part in range(PARTS):
        held = set(names[part::PARTS])
        judged = [item for item in left_out if item.take in held]
        settings = effect.learned([item for item in left_out if item.take not in held], found)
        for item in judged:
            error.append(item.error)
            before.append(item.variance)
            after.append(item.variance + _added(effect, settings, item))
    errors = np.concatenate(error)
    claims = [_claim(errors, np.concatenate(each)) for each in (before, after)]
    return ClaimCheck(claims[0], claims[1], limits)


def _added(effect: IntervalEffect, settings: Settings, item: LeftOutErrors) -> np.ndarray:
    interval = effect.interval(settings, [item.rotation], item.sensors, np.array([item.noise]))
    return interval.added_variance(item.since_start_s, item.readings)[:, 0]


def _claim(error: np.ndarray, variance: np.ndarray) -> Claim:
    scaled = error**2 / variance
    return Claim(
        float(np.mean(0.5 * np.log(2 * np.pi * variance) + 0.5 * scaled)),
        float(np.mean(scaled <= 1.0)),
        float(np.mean(scaled <= 1.959964**2)),
    )
