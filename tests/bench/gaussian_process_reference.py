"""The judge of the bench: one dense float64 likelihood, written down as plainly as possible.

Every contestant hands over its hyperparameters; what it believes its own likelihood to be does not count.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve


@dataclass(frozen=True)
class Hyperparameters:
    """y ~ N(mean + plane, signal SE(lengthscales) + linear kernel + noise), all in standardised units."""

    lengthscales: np.ndarray
    signal: float
    noise: float
    linear: np.ndarray | None = None
    """Variances of slopes and offset (D + 1,) where the linear part is a covariance, not a mean."""


@dataclass(frozen=True)
class Trained:
    """What a contestant brings back from one training."""

    who: str
    cpu_s: float
    hyperparameters: Hyperparameters | None
    note: str = ""
    own_objective: float | None = None
    evaluations: int | None = None
    facts: dict[str, Any] = field(default_factory=dict)


def exact_nlml(x: np.ndarray, y: np.ndarray, given: Hyperparameters) -> float:
    """Negative log marginal likelihood at ``given``; a mean plane takes its best coefficients."""
    z = x / given.lengthscales
    squared = np.sum(z**2, axis=1)[:, None] + np.sum(z**2, axis=1)[None, :] - 2.0 * z @ z.T
    covariance = given.signal * np.exp(-0.5 * np.maximum(squared, 0.0))
    design = np.column_stack([x, np.ones(len(x))])
    if given.linear is not None:
        covariance += (design * given.linear) @ design.T
    covariance[np.diag_indices(len(x))] += given.noise
    factor = cho_factor(covariance, lower=True)
    residual = y
    if given.linear is None:
        solved = cho_solve(factor, design)
        residual = y - design @ np.linalg.solve(design.T @ solved, solved.T @ y)
    quadratic = residual @ cho_solve(factor, residual)
    determinant = 2.0 * np.log(np.diag(factor[0])).sum()
    return float(0.5 * (quadratic + determinant + len(y) * np.log(2.0 * np.pi)))
