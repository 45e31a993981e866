"""A trained process of any covariance, served on as few nodes as its prediction needs.

With K ~ F' F, F = L^-1 k(nodes, x) from a pivoted Cholesky factorisation (Harbrecht, Peters & Schneider
2012), the process is a Bayesian line in the features L^-1 k(nodes, x): G = F N^-1 F' (N the noise of each
input) has its mean weights (I + G)^-1 F N^-1 r and its explained variance G (I + G)^-1. A polynomial of
degree 3 in two sensors has ten features, however many samples there were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, eigh, solve_triangular

from glovecal_models.covariance.base import Covariance
from glovecal_models.regression.counted_likelihood import Posterior


@dataclass(frozen=True)
class FewNodes:
    """mean - plane = k(x, nodes) @ weights; variance = k(x, x) - |k(x, nodes) @ variance_root|^2."""

    nodes: np.ndarray
    """(M, D), working units."""
    weights: np.ndarray
    """(M,)."""
    variance_root: np.ndarray
    """(M, M)."""
    mean_error: float
    """Largest difference from the exact process at the training inputs, working units."""
    sd_error: float


def few_nodes(
    covariance: Covariance,
    theta: np.ndarray,
    x: np.ndarray,
    posterior: Posterior,
    *,
    mean_error: float,
    sd_error: float,
) -> FewNodes:
    """The fewest nodes found that stay within both errors (working units); all of x (m, D) if none do."""
    values = covariance(theta, x, x)
    exact_mean = values @ posterior.weights
    explained = solve_triangular(posterior.lower, values, lower=True, check_finite=False)
    prior = covariance.diagonal(theta, x)
    exact_sd = np.sqrt(np.maximum(prior - np.einsum("nm,nm->m", explained, explained), 0.0))
    for tolerance in (1e-4, 1e-6, 1e-8):
        rows, pivots = _factor(values, tolerance * float(posterior.noise.min()), len(x) // 2)
        found = _on_pivots(rows, pivots, x, posterior)
        to_nodes = values[:, pivots]
        parts = to_nodes @ found.variance_root
        sd = np.sqrt(np.maximum(prior - np.einsum("mr,mr->m", parts, parts), 0.0))
        errors = (
            float(np.abs(to_nodes @ found.weights - exact_mean).max()),
            float(np.abs(sd - exact_sd).max()),
        )
        if errors[0] <= mean_error and errors[1] <= sd_error:
            return FewNodes(found.nodes, found.weights, found.variance_root, *errors)
    root = solve_triangular(posterior.lower, np.eye(len(x)), lower=True, check_finite=False).T
    return FewNodes(x, cho_solve((posterior.lower, True), posterior.residual), root, 0.0, 0.0)


def _factor(values: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows F (r, m) with values ~ F' F, and the pivots (r,), until no diagonal is left above tolerance."""
    rows, residual = np.empty((most, len(values))), np.diagonal(values).copy()
    least = max(tolerance, 1e-12 * float(residual.max()))
    pivots: list[int] = []
    while len(pivots) < most:
        pivot = int(residual.argmax())
        if residual[pivot] <= least:
            break
        rank = len(pivots)
        row = values[pivot] - rows[:rank, pivot] @ rows[:rank]
        rows[rank] = row / np.sqrt(residual[pivot])
        residual = np.maximum(residual - rows[rank] ** 2, 0.0)
        residual[pivot] = 0.0
        pivots.append(pivot)
    return rows[: len(pivots)], np.array(pivots, dtype=np.intp)


def _on_pivots(rows: np.ndarray, pivots: np.ndarray, x: np.ndarray, posterior: Posterior) -> FewNodes:
    whitened = rows / np.sqrt(posterior.noise)
    informed, directions = eigh(whitened @ whitened.T, check_finite=False)
    informed = np.maximum(informed, 0.0)
    right = directions.T @ (whitened @ (posterior.residual / np.sqrt(posterior.noise)))
    features = np.column_stack(
        [directions @ (right / (1 + informed)), directions * np.sqrt(informed / (1 + informed))]
    )
    corner = np.tril(rows[:, pivots].T)
    back = solve_triangular(corner, features, lower=True, trans=1, check_finite=False)
    return FewNodes(x[pivots], back[:, 0], back[:, 1:], np.inf, np.inf)
