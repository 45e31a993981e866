"""How the error of one rotation wanders inside takes: the rate of a random walk.

The error is averaged over 10 s. Frame noise and everything that is stationary within 10 s (misfit that comes
and goes with the posture) give such means a variance that can be worked out from the 10 s themselves; what
they vary by beyond it is the walk's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

MEAN_S = 10.0
SHORT_S = 1.0
LEAST_MEANS = 3
"""Of a take, for it to count; over all takes twice as many."""
POSTURE_DEGREE = 3


def slip_rate(
    times: Sequence[np.ndarray], errors: Sequence[np.ndarray], angles: Sequence[np.ndarray]
) -> float | None:
    """By how many degrees the errors (N,) of each take wander in a minute, with the root of the time; None
    when the takes are too short to say.

    ``times`` (N,) in seconds, ``angles`` (N,) measured, degrees.
    """
    errors = without_posture(errors, angles)
    groups = [_short_means(time, error) for time, error in zip(times, errors, strict=True)]
    groups = [group for group in groups if len(group) >= LEAST_MEANS]
    if sum(map(len, groups)) < 2 * LEAST_MEANS:
        return None
    long = [group.mean(axis=1) for group in groups]
    free = sum(len(means) - 1 for means in long)
    squares = sum(float(np.sum((means - means.mean()) ** 2)) for means in long)
    excess = max(squares / free - _stationary_variance(np.concatenate(groups)), 0.0)
    # A walk of rate q gives J means of length T a variance of q² T (J + 1) / 6.
    walked = sum(MEAN_S * (len(means) + 1) / 6.0 * (len(means) - 1) for means in long) / free
    return float(np.sqrt(60.0 * excess / walked))


def without_posture(errors: Sequence[np.ndarray], angles: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Errors less a smooth function of the joint's own angle: a curve that is missing is not a slip."""
    every = np.concatenate(angles)
    known = np.isfinite(every) & np.isfinite(np.concatenate(errors))
    if known.sum() < 100 or every[known].std() < 1.0:
        return list(errors)
    centre, scale = every[known].mean(), 2.0 * every[known].std()

    def powers(angle: np.ndarray) -> np.ndarray:
        return np.vander((angle - centre) / scale, POSTURE_DEGREE + 1)

    weights = np.linalg.lstsq(powers(every[known]), np.concatenate(errors)[known], rcond=None)[0]
    return [error - powers(angle) @ weights for error, angle in zip(errors, angles, strict=True)]


def _short_means(time_s: np.ndarray, error: np.ndarray) -> np.ndarray:
    """(J, 10) means over 1 s, a row for each complete 10 s; (0, 10) when there are none."""
    per = round(MEAN_S / SHORT_S)
    known = np.isfinite(error)
    if not known.any():
        return np.empty((0, per))
    second = ((time_s - time_s[0]) / SHORT_S).astype(int)
    count = np.bincount(second, known)
    total = np.bincount(second, np.where(known, error, 0.0))
    means = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    rows = means[: len(means) // per * per].reshape(-1, per)
    return rows[np.isfinite(rows).all(axis=1)]


def _stationary_variance(rows: np.ndarray) -> float:
    """Variance of the mean of a row, were the rows (J, T) pieces of an autoregressive noise of order one."""
    inside = rows - rows.mean(axis=1, keepdims=True)
    length = rows.shape[1]
    variance = float(np.sum(inside**2)) / (len(rows) * (length - 1))
    correlation = float(np.sum(inside[:, 1:] * inside[:, :-1]) / max(float(np.sum(inside**2)), 1e-300))
    # Taking the mean of so short a row away makes it look less correlated than it is.
    correlation = float(np.clip(correlation + (1.0 + 3.0 * correlation) / length, 0.0, 0.8))
    return variance / length * (1.0 + correlation) / (1.0 - correlation)


def frame_noise(errors: Sequence[np.ndarray], times: Sequence[np.ndarray]) -> float:
    """RMS, degrees, of what is quicker than a second."""
    total, count = 0.0, 0
    for time, error in zip(times, errors, strict=True):
        known = np.isfinite(error)
        if known.any():
            second = ((time - time[0]) / SHORT_S).astype(int)[known]
            frames = np.maximum(np.bincount(second), 1)
            left = error[known] - (np.bincount(second, error[known]) / frames)[second]
            total, count = total + float(np.sum(left**2)), count + len(left)
    return float(np.sqrt(total / max(count, 1)))
