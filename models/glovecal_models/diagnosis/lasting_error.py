"""How large the part of an error is that lasts for seconds, and how surely that is known.

Means of neighbouring seconds are multiplied: noise that is forgotten within a second averages to nothing,
whatever its size; an error that lasts gives its mean square. How far the products differ from one stretch of
the recording to the next says how much can be known: few stretches, or an error that is large only once,
give a low bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from glovecal_models.diagnosis.second_means import SecondMeans

STRETCH_S = 10
SHORTEST_S = 4
"""A shorter take says nothing of what lasts."""
FEWEST_STRETCHES = 5
CONFIDENCE = 0.95


@dataclass(frozen=True)
class LastingError:
    """One joint, degrees root mean square; over the stretches in which it was measured."""

    size_deg: float
    at_least_deg: float
    """Lower end of the one-sided 95 % interval."""
    noise_deg: float
    """From row to row."""
    stretches: int

    @property
    def is_judgeable(self) -> bool:
        return self.stretches >= FEWEST_STRETCHES


def lasting_error(takes: Sequence[SecondMeans], residual: Sequence[np.ndarray]) -> LastingError:
    """``residual``: the same joint's error row by row, for its noise."""
    products, weights = [], []
    for take in takes:
        both = take.weight[1:] * take.weight[:-1] > 0
        weight = np.sqrt(take.weight[1:] * take.weight[:-1])[both]
        product = (take.mean_deg[1:] * take.mean_deg[:-1])[both] * weight
        if len(weight) < SHORTEST_S - 1:
            continue
        for part in np.array_split(np.arange(len(weight)), max(1, round(len(weight) / STRETCH_S))):
            products.append(float(product[part].sum()))
            weights.append(float(weight[part].sum()))
    noise = _noise(residual)
    if not products:
        return LastingError(0.0, 0.0, noise, 0)
    total, count = sum(weights), len(products)
    square = max(sum(products) / total, 0.0)
    differing = np.array(products) - square * np.array(weights)
    variance = count / max(count - 1, 1) * float(np.sum(differing**2)) / total**2
    return LastingError(_root(square), _root(_lower(square, variance, count)), noise, count)


def _lower(square: float, variance: float, count: int) -> float:
    """Of a mean square whose estimate varies so much: as of a scaled chi squared (Satterthwaite 1946)."""
    freedom = min(2 * square**2 / max(variance, 1e-30), count - 1.0)
    return square * freedom / float(chi2.ppf(CONFIDENCE, freedom)) if freedom > 0 else 0.0


def _root(square: float) -> float:
    return float(np.sqrt(max(square, 0.0)))


def _noise(residual: Sequence[np.ndarray]) -> float:
    """Standard deviation of what changes from row to row, by the median of squared differences."""
    steps = np.concatenate([np.diff(part) for part in residual]) if residual else np.empty(0)
    return float(np.sqrt(np.median(steps**2) / 0.4549)) if len(steps) else 0.0
