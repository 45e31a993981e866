"""Is something left that no known effect explains? Errors that last, or that joints share, are no noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.directions import Direction

WINDOW_ROWS = 25
"""1 s of the rows that are fitted: what remains after averaging over it is slow."""
SLOW_RATIO = 5.6
"""Of 1 s means over what changes from row to row. 60 simulated gloves without a cause: 2.2 to 5.8, one
above the limit; most with an unknown cause of 1 degree 7 to 12, a tilt on one joint from 5."""
SHARED_RATIO = 12.0
"""Without a cause 0.5 to 8.5, with a common swing 18 and more."""
SHIFTS = 60


@dataclass(frozen=True)
class Left:
    """The answer, and what it rests on."""

    is_left: bool
    slow: dict[str, float]
    """For each joint: slow part of the held-out error over its noise from row to row."""
    shared: float
    """Correlation between joints' slow errors over what shifts in time give."""
    sentence: str


NOT_TOLD = Left(False, {}, 0.0, "Single poses do not tell whether something is left that lasts.")


def something_left(direction: Direction, seed: int = 0) -> Left:
    """Judge the held-out residuals of ``direction``, known effects included in its base."""
    slow = {}
    series = []
    for joint, name in enumerate(direction.rotations):
        means = [_means(part) for part in direction.products[joint].residual]
        every = np.concatenate(means)
        fast = np.concatenate([np.diff(part) for part in direction.products[joint].residual])
        noise = float(np.sqrt(np.median(fast**2) / 0.4549)) if len(fast) else 0.0
        slow[name] = float(np.sqrt(np.mean(every**2))) / max(noise, 1e-6) if len(every) else 0.0
        series.append(means)
    shared = _shared(series, np.random.default_rng(seed))
    worst = max(slow, key=lambda name: slow[name]) if slow else ""
    is_slow = bool(slow) and slow[worst] > SLOW_RATIO
    is_shared = shared > SHARED_RATIO
    if not is_slow and not is_shared:
        return Left(False, slow, shared, "What is left looks like noise.")
    why = []
    if is_slow:
        why.append(f"the error of {worst} lasts for seconds ({slow[worst]:.1f} times its noise)")
    if is_shared:
        why.append("the errors of several joints rise and fall together")
    return Left(True, slow, shared, f"Something is left that no known effect explains: {' and '.join(why)}.")


def _means(residual: np.ndarray) -> np.ndarray:
    length = len(residual) // WINDOW_ROWS * WINDOW_ROWS
    return residual[:length].reshape(-1, WINDOW_ROWS).mean(axis=1)


def _shared(series: Sequence[Sequence[np.ndarray]], generator: np.random.Generator) -> float:
    """Mean squared correlation between joints over that of shifted ones; 0 with a single joint."""
    if len(series) < 2:
        return 0.0
    takes = [
        np.array([joint[t][: min(len(other[t]) for other in series)] for joint in series])
        for t in range(len(series[0]))
    ]
    takes = [part - part.mean(axis=1, keepdims=True) for part in takes if part.shape[1] >= 8]
    if not takes:
        return 0.0

    def strength(parts: Sequence[np.ndarray]) -> float:
        together = np.concatenate(parts, axis=1)
        matrix = np.atleast_2d(np.corrcoef(together + 1e-12 * generator.standard_normal(together.shape)))
        upper = matrix[np.triu_indices(len(together), 1)]
        return float(np.mean(upper**2))

    true = strength(takes)
    chance = []
    for _ in range(SHIFTS):
        moved = [
            np.array([np.roll(row, generator.integers(2, max(3, len(row) - 1))) for row in part])
            for part in takes
        ]
        chance.append(strength(moved))
    return true / max(float(np.mean(chance)), 1e-12)
