"""Does an error depend on a column, or is it noise? A test that survives errors that are alike in time.

The error is averaged in bins of the column. How much the bin means spread is compared with what the same
error series gives when it is shifted in time against the column, each take by its own random amount and
around its end: that keeps how alike neighbouring frames are, and breaks only the tie to the column. All
shifts of a take come from one Fourier transform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.covariates import Covariate

BINS = 8
SHIFTS = 999
SHORTEST_SHIFT = 0.05
"""Share of a take below which a shift leaves nearly the same pairing."""
FEWEST_STEPS = 16
"""A shorter take has too few different shifts; it is left out of the test."""
STEPS_AT_MOST = 4000


@dataclass(frozen=True)
class Dependence:
    """The error of one rotation against one covariate."""

    covariate: str
    unit: str
    phrase: str
    edges: np.ndarray
    """Bin edges, (B + 1,), in the covariate's unit."""
    mean_deg: np.ndarray
    """Mean error in each bin, (B,)."""
    count: np.ndarray
    """Frames in each bin, (B,)."""
    chance_deg: np.ndarray
    """How far 95 % of the shifts take a bin's mean from the mean of all, (B,); NaN: not tested."""
    explained_deg: float
    """Root mean square of the bin means' deviation from their mean: what this column explains, degrees."""
    probability: float
    """Share of shifts that explain as much (p value); 1 where it could not be tested."""


def dependence(
    errors: tuple[np.ndarray, ...], covariate: Covariate, generator: np.random.Generator
) -> Dependence | None:
    """``errors``: for each take (N,), degrees. None when the covariate takes fewer than two values."""
    usable = [np.isfinite(e) & np.isfinite(v) for e, v in zip(errors, covariate.values, strict=True)]
    pairs = [(e[u], v[u]) for e, v, u in zip(errors, covariate.values, usable, strict=True) if u.any()]
    if not pairs:
        return None
    error, value = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    edges = np.unique(np.quantile(value, np.linspace(0, 1, BINS + 1)))
    if len(edges) < 2:
        return None
    bins = len(edges) - 1
    where = _bin(value, edges)
    count = np.bincount(where, minlength=bins)
    mean = np.bincount(where, error, minlength=bins) / np.maximum(count, 1)
    spread = float(np.sqrt(np.average((mean - error.mean()) ** 2, weights=count)))
    series = [_thinned(e - error.mean(), _bin(v, edges)) for e, v in pairs]
    chance, probability = _against_shifts(series, bins, generator)
    return Dependence(
        covariate.name, covariate.unit, covariate.phrase, edges, mean, count, chance, spread, probability
    )


def _bin(value: np.ndarray, edges: np.ndarray) -> np.ndarray:
    return np.clip(np.searchsorted(edges, value, side="right") - 1, 0, len(edges) - 2)


def _thinned(error: np.ndarray, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over neighbouring frames of a long take, with the bin of the middle one."""
    step = -(-len(error) // STEPS_AT_MOST)
    length = len(error) // step * step
    return error[:length].reshape(-1, step).mean(axis=1), where[step // 2 : length : step]


def _against_shifts(
    series: list[tuple[np.ndarray, np.ndarray]], bins: int, generator: np.random.Generator
) -> tuple[np.ndarray, float]:
    """What the shifts make of each bin's mean, and the share of them that spread the means as widely."""
    tested = [item for item in series if len(item[0]) >= FEWEST_STEPS]
    if not tested:
        return np.full(bins, np.nan), 1.0
    sums, counts = np.zeros((SHIFTS + 1, bins)), np.zeros(bins)
    for error, where in tested:
        shifts = np.append(0, _random_shifts(len(error), generator))
        sums += _shifted_sums(error, where, bins)[:, shifts].T
        counts += np.bincount(where, minlength=bins)
    spread = np.sum(sums**2 / np.maximum(counts, 1), axis=1)
    chance = np.percentile(np.abs(sums[1:] / np.maximum(counts, 1)), 95, axis=0)
    return chance, float((1 + np.count_nonzero(spread[1:] >= spread[0])) / (SHIFTS + 1))


def _random_shifts(length: int, generator: np.random.Generator) -> np.ndarray:
    least = max(1, round(SHORTEST_SHIFT * length))
    return generator.integers(least, length - least + 1, SHIFTS)


def _shifted_sums(error: np.ndarray, where: np.ndarray, bins: int) -> np.ndarray:
    """(bins, N): sum of the error in each bin after shifting it by 0 to N - 1 steps."""
    indicator = (where == np.arange(bins)[:, None]).astype(float)
    product = np.fft.rfft(error) * np.conj(np.fft.rfft(indicator, axis=1))
    return np.fft.irfft(product, n=len(error), axis=1)
