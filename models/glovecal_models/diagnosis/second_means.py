"""Held-out errors averaged over whole seconds: noise from frame to frame cancels, what lasts stays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from glovecal_models.calibration.held_out import ALIKE_ROWS, BaseProducts
from glovecal_models.diagnosis.directions import Direction

EVERY = 5
"""Neighbouring rows are about equally unfamiliar."""
LEAST_FILLED = 0.5
"""Share of a second's rows that must have been measured."""


@dataclass(frozen=True)
class SecondMeans:
    """One joint in one take of S seconds."""

    mean_deg: np.ndarray
    """(S,), sensor minus what the base says; 0 where too little was measured."""
    weight: np.ndarray
    """(S,), 1 where the base knows such inputs well, towards 0 where it guesses; 0 where not measured."""


def second_means(direction: Direction, joint: int) -> list[SecondMeans]:
    """For each take of the direction."""
    products = direction.products[joint]
    found = []
    for number, take in enumerate(direction.signals):
        mine = [unit for unit, owner in enumerate(direction.unit_take) if owner == number]
        rows = [direction.used[joint][unit] for unit in mine]
        start = take.time_s[0] if len(take.time_s) else 0.0
        seconds = int(take.time_s[-1] - start) if len(take.time_s) else 0
        at = np.concatenate([take.time_s[index] - start for index in rows]).astype(int)
        residual = np.concatenate([products.residual[unit] for unit in mine])
        unfamiliar = np.concatenate([_unfamiliar(products, unit) for unit in mine])
        inside = at < seconds
        count = np.bincount(at[inside], minlength=seconds)
        whole = np.median(count[count > 0]) if count.any() else 1.0
        filled = count >= LEAST_FILLED * whole
        mean, leverage = (
            np.bincount(at[inside], values[inside], minlength=seconds) / np.maximum(count, 1)
            for values in (residual, unfamiliar)
        )
        weight = np.where(filled & (count > 0), 1 / (1 + leverage), 0.0)
        found.append(SecondMeans(np.where(weight > 0, mean, 0.0), weight))
    return found


def without_drift(take: SecondMeans) -> SecondMeans:
    """Without the take's mean and straight line: what is left wanders within the take."""
    known = take.weight > 0
    if known.sum() < 3:
        return take
    at, weight = np.flatnonzero(known), take.weight[known]
    line = np.polyfit(at, take.mean_deg[known], 1, w=np.sqrt(weight))
    rest = np.zeros_like(take.mean_deg)
    rest[known] = take.mean_deg[known] - np.polyval(line, at)
    return SecondMeans(rest, take.weight)


def _unfamiliar(products: BaseProducts, unit: int) -> np.ndarray:
    """(N,): variance of the base's own error on a unit left out, over the variance of what it was fitted to.

    x' G^-1 x of linear regression, G of all other units, with so many rows counted as one as are alike.
    """
    base = products.units[unit].base
    if not len(base):
        return np.empty(0)
    lower = cholesky(products.gram.sum(axis=0) - products.gram[unit] + products.ridge, lower=True)
    solved = solve_triangular(lower, base[::EVERY].T, lower=True)
    return ALIKE_ROWS * np.repeat((solved**2).sum(axis=0), EVERY)[: len(base)]
