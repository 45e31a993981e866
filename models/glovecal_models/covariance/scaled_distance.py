"""Squared distances in scaled inputs and the sums over them that gradients need; no N x N x D arrays."""

from __future__ import annotations

import numpy as np

_BLOCK_ENTRIES = 32_768


def squared_exponential(
    log_variance: float,
    inverse_lengthscales: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """exp(log_variance - 1/2 |L (a - b)|^2) with L = diag(inverse_lengthscales); (A, D), (B, D) -> (A, B).

    The distance is expanded (one matrix product), so points are moved to b's middle first: the rounding
    error grows with their distance from the origin. A slightly negative distance is cut to zero.
    """
    middle = b.mean(axis=0)
    a, b = (a - middle) * inverse_lengthscales, (b - middle) * inverse_lengthscales
    a_terms = np.column_stack([a, -0.5 * np.einsum("id,id->i", a, a), np.ones(len(a))])
    b_terms = np.column_stack([b, np.ones(len(b)), -0.5 * np.einsum("id,id->i", b, b)])
    values = np.matmul(a_terms, b_terms.T, out=out)
    np.minimum(values, 0.0, out=values)
    np.exp(values, out=values)
    return np.multiply(values, np.exp(log_variance), out=values)


def weighted_differences(
    weights: np.ndarray, values: np.ndarray, relevance: np.ndarray, a: np.ndarray, b: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Sums over T = weights * values (A, B), values being a k of sum_d relevance_d (a_d - b_d)^2 / 2.

    Returns sum(T), the gradient by log relevance (D,), and by a (A, D). T is never built whole: blocks
    of it stay in the cache.
    """
    towards, rows, columns = np.empty_like(a), np.empty(len(a)), np.zeros(len(b))
    block = max(1, _BLOCK_ENTRIES // max(len(b), 1))
    product = np.empty((block, len(b)))
    for start in range(0, len(a), block):
        part = slice(start, start + block)
        size = len(rows[part])
        weighted = np.multiply(weights[part], values[part], out=product[:size])
        towards[part] = weighted @ b
        rows[part] = weighted.sum(axis=1)
        columns += weighted.sum(axis=0)
    squares = rows @ (a * a) - 2 * (a * towards).sum(axis=0) + columns @ (b * b)
    return float(rows.sum()), -0.5 * relevance * squares, relevance * (towards - rows[:, None] * a)
