"""How strong a disturbance is: the part of it that calibration cannot take away without knowing the cause."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

OWN_MAP_TERMS = 8
"""Legendre terms that stand for any smooth static map of the own angle."""
READING_SD_DEG = 0.3
READING_STEP_DEG = 0.25


class Unexplained:
    """RMS of what is left of a disturbance after the best smooth function of the own angle.

    ``own`` are all frames of a session, shape (M, S) degrees; ``terms`` 2 stands for straight lines.
    """

    def __init__(self, own: np.ndarray, terms: int = OWN_MAP_TERMS) -> None:
        self._bases = [_orthonormal_basis(column, terms) for column in own.T]

    def rms(self, disturbance: np.ndarray) -> np.ndarray:
        """Shape (S,), degrees, from ``disturbance`` of shape (M, S), degrees."""
        left = [
            column - basis @ (basis.T @ column)
            for basis, column in zip(self._bases, disturbance.T, strict=True)
        ]
        return np.sqrt(np.mean(np.square(left), axis=1))


def lost_angle_rms(own: np.ndarray, clean: np.ndarray, changed: np.ndarray) -> np.ndarray:
    """How much less a noisy reading says about the angle, shape (S,), degrees RMS.

    ``own``, ``clean`` and ``changed`` have shape (M, S), degrees, without noise. A noise of
    ``READING_SD_DEG`` is added, without which a nearly flat curve would lose nothing.
    """
    noise = READING_SD_DEG * np.random.default_rng(0).standard_normal(len(own))
    trios = zip(own.T, clean.T, changed.T, strict=True)
    lost = [
        _spread_within(a, after + noise) - _spread_within(a, before + noise) for a, before, after in trios
    ]
    return np.sqrt(np.maximum(lost, 0.0))


def sizes_for(
    measure: Callable[[np.ndarray], np.ndarray],
    targets: np.ndarray,
    bounds: tuple[float, float],
    *,
    shared: bool,
    rounds: int = 16,
) -> np.ndarray:
    """Sizes, shape (S,), at which ``measure`` (growing in each sensor's own size) gives ``targets`` (S,).

    ``shared`` asks for one size whose RMS over sensors is that of the targets. Bounds that are too narrow
    give the nearest bound.
    """
    low, high = (np.full(len(targets), bound) for bound in bounds)
    size = np.sqrt(low * high)
    for _ in range(rounds):
        reached = measure(size)
        wanted = targets
        if shared:
            reached = np.full(len(targets), np.sqrt(np.mean(reached**2)))
            wanted = np.full(len(targets), np.sqrt(np.mean(targets**2)))
        if np.all(np.abs(reached / wanted - 1) < 0.01):
            break
        low = np.where(reached < wanted, size, low)
        high = np.where(reached < wanted, high, size)
        guess = size * np.clip(wanted / np.maximum(reached, 1e-9), 0.2, 5.0)
        inside = (guess > low) & (guess < high)
        settled = np.abs(reached / wanted - 1) < 0.01
        size = np.where(settled, size, np.where(inside, guess, np.sqrt(low * high)))
    return size


def _orthonormal_basis(angle: np.ndarray, terms: int) -> np.ndarray:
    low, high = angle.min(), angle.max()
    if high - low < 1e-6:
        return np.full((len(angle), 1), 1 / np.sqrt(len(angle)))
    columns = np.polynomial.legendre.legvander(2 * (angle - low) / (high - low) - 1, terms - 1)
    return np.linalg.qr(columns)[0]


def _spread_within(angle: np.ndarray, reading: np.ndarray) -> float:
    group = np.rint((reading - reading.min()) / READING_STEP_DEG).astype(int)
    count = np.maximum(np.bincount(group), 1)
    mean = np.bincount(group, angle) / count
    return float(np.mean((angle - mean[group]) ** 2))
