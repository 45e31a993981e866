"""Squared distances in scaled inputs and the sums over them that gradients need; no N x N x D arrays."""

from __future__ import annotations

import numpy as np


def squared_exponential(
    log_variance: float, inverse_lengthscales: np.ndarray, a: np.ndarray, b: np.ndarray
) -> np.ndarray:
    """exp(log_variance - 1/2 |L (a - b)|^2) with L = diag(inverse_lengthscales); (A, D), (B, D) -> (A, B).

    The distance is expanded (one matrix product), so points are moved to b's middle first: the rounding
    error grows with their distance from the origin. A slightly negative distance is cut to zero.
    """
    middle = b.mean(axis=0)
    a, b = (a - middle) * inverse_lengthscales, (b - middle) * inverse_lengthscales
    values = a @ b.T
    values -= 0.5 * np.einsum("id,id->i", a, a)[:, None]
    values -= 0.5 * np.einsum("id,id->i", b, b)
    np.minimum(values, 0.0, out=values)
    values += log_variance
    return np.exp(values, out=values)


def weighted_differences(
    weighted: np.ndarray, relevance: np.ndarray, a: np.ndarray, b: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Sums over T = weights * k (A, B) for a k that depends on sum_d relevance_d (a_d - b_d)^2 / 2.

    Returns sum(T), the gradient by log relevance (D,), and by a (A, D).
    """
    moment = weighted @ np.column_stack([b, np.ones(len(b))])
    towards, rows = moment[:, :-1], moment[:, -1:]
    columns = np.ones(len(a)) @ weighted
    squares = (rows * a * a).sum(axis=0) - 2 * (a * towards).sum(axis=0) + columns @ (b * b)
    return float(rows.sum()), -0.5 * relevance * squares, relevance * (towards - rows * a)
