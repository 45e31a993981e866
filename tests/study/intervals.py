"""95 % intervals: Wilson's or exact ones for counts, bootstrap for means and quantiles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import beta

QUANTILE = 1.959964
RESAMPLES = 2000


def wilson(count: int, total: int) -> tuple[float, float]:
    """Between which shares the true one lies (Wilson 1927); 0 to 1 when nothing was counted."""
    if total == 0:
        return 0.0, 1.0
    share, spread = count / total, QUANTILE**2 / total
    middle = (share + spread / 2) / (1 + spread)
    half = QUANTILE * np.sqrt(share * (1 - share) / total + spread / (4 * total)) / (1 + spread)
    return max(float(middle - half), 0.0), min(float(middle + half), 1.0)


def clopper_pearson(count: int, total: int) -> tuple[float, float]:
    """The same, exact (Clopper and Pearson 1934); 0 to 1 when nothing was counted."""
    low = float(beta.ppf(0.025, count, total - count + 1)) if count else 0.0
    high = float(beta.ppf(0.975, count + 1, total - count)) if count < total else 1.0
    return low, high


def bootstrap(
    values: Sequence[float], seed: int = 0, *, quantile: float | None = None
) -> tuple[float, float]:
    """Between which means (or quantiles) the true one lies, by drawing ``values`` again; NaN without any."""
    if not len(values):
        return float("nan"), float("nan")
    random = np.random.default_rng(seed)
    drawn = random.choice(np.asarray(values, float), (RESAMPLES, len(values)))
    found = drawn.mean(axis=1) if quantile is None else np.quantile(drawn, quantile, axis=1)
    low, high = np.quantile(found, [0.025, 0.975])
    return float(low), float(high)
