"""Where SPGP's pseudo-inputs start: at the samples the process itself finds hardest to explain."""

from __future__ import annotations

import numpy as np

from glovecal_models.covariance.base import Covariance

_EXPLAINED = 1e-9
"""A sample whose remaining variance is below this part of the largest prior variance needs no node."""


def choose_pseudo_inputs(
    covariance: Covariance, theta: np.ndarray, x: np.ndarray, count: int, generator: np.random.Generator
) -> np.ndarray:
    """At most ``count`` different rows of x (N, D): pivoted Cholesky of k(x, x), then random rows.

    The next row is the one the rows so far explain worst. Once all are explained the rest is drawn at
    random, since training changes the hyperparameters. Fewer come back only if x has fewer different rows.
    """
    distinct = np.unique(x, axis=0)
    count = min(count, len(distinct))
    factor = np.empty((count, len(distinct)))
    residual = covariance.diagonal(theta, distinct)
    tolerance = _EXPLAINED * float(residual.max())
    chosen: list[int] = []
    while len(chosen) < count:
        pivot = int(residual.argmax())
        if residual[pivot] <= tolerance:
            break
        row = covariance(theta, distinct[pivot : pivot + 1], distinct)[0]
        row -= factor[: len(chosen), pivot] @ factor[: len(chosen)]
        row /= np.sqrt(residual[pivot])
        factor[len(chosen)] = row
        residual = np.maximum(residual - row * row, 0.0)
        residual[pivot] = 0.0
        chosen.append(pivot)
    left = np.setdiff1d(np.arange(len(distinct)), chosen)
    drawn = generator.permutation(left)[: count - len(chosen)]
    return distinct[np.concatenate([np.array(chosen, dtype=int), drawn])]
