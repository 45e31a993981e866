"""How much of an independent sample each sample is: errors that last for many frames are one error.

Where a sensor misses something that the rotation depends on, the model's error is nearly the same in the
next frame. N such samples tell as much as N / (1 + 2 sum_k rho_k) independent ones, rho_k the correlation
of errors k frames apart (the integrated autocorrelation time; Kish's design effect in surveys).
"""

from __future__ import annotations

import numpy as np

FADED = 0.05
"""Correlation at which errors are taken for independent: what follows is scatter of the estimate."""
LEAST_PAIRS = 30
WIDENING = 0.3
"""Lags are looked at together in ranges this part of their start: 1, 2, 3, 4, 5, 6-7, 8-10 ... frames."""


def independent_share(error: np.ndarray, take: np.ndarray, position: np.ndarray) -> float:
    """Between 1 / N and 1, for errors (N,) at frames ``position`` (N,), whole numbers, of ``take`` (N,)."""
    whole = float(error @ error)
    if whole == 0.0:
        return 1.0
    products, pairs = _by_lag(error, take, position)
    total, start = whole, 1
    while start < len(pairs):
        end = start + max(1, int(WIDENING * start))
        while end < len(pairs) and pairs[start:end].sum() < LEAST_PAIRS:
            end += 1
        count, together = pairs[start:end].sum(), float(products[start:end].sum())
        if count == 0 or together / count <= FADED * whole / len(error):
            break
        total += 2.0 * together
        start = end
    return float(np.clip(whole / total, 1.0 / len(error), 1.0))


def _by_lag(error: np.ndarray, take: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum of products of errors, and number of pairs, for each distance in frames within a take."""
    owned = [np.flatnonzero(take == owner) for owner in np.unique(take)]
    longest = max(int(np.ptp(position[rows])) + 1 for rows in owned)
    products, pairs = np.zeros(longest), np.zeros(longest)
    for rows in owned:
        at = position[rows] - position[rows].min()
        length = int(at.max()) + 1
        frames = np.zeros((2, length))
        frames[0, at], frames[1, at] = error[rows], 1.0
        size = 1 << int(2 * length - 1).bit_length()
        power = np.abs(np.fft.rfft(frames, size)) ** 2
        correlated = np.fft.irfft(power, size)[:, :length]
        products[:length] += correlated[0]
        pairs[:length] += np.round(correlated[1])
    return products, pairs
