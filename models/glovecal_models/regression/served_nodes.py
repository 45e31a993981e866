"""A trained process on few nodes: what is stored, and what predicts at 120 frames a second.

LMC-GPR: nodes are pivots of a pivoted Cholesky factorisation, not moved (Foster et al. 2009; the DTC or
projected process mean of Quinonero-Candela & Rasmussen 2005). With K ~ L L', Lp the pivots' own triangle and
G = L' S^2 L, C = Lp^-T (I - rho (G + rho I)^-1) Lp^-1: no difference of nearly equal inverses is ever taken.

Any other covariance: with K ~ F' F, F = L^-1 k(nodes, x) from a pivoted Cholesky factorisation (Harbrecht,
Peters & Schneider 2012), the process is a Bayesian line in the features L^-1 k(nodes, x): G = F N^-1 F' (N
the noise of each input) has its mean weights (I + G)^-1 F N^-1 r and its explained variance G (I + G)^-1. A
polynomial of degree 3 in two sensors has ten features, however many samples there were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, eigh, solve_triangular

from glovecal_models.covariance.base import Covariance
from glovecal_models.regression.exact import Posterior
from glovecal_models.regression.factorisation import PivotedCholesky, factor_by_rows, potrf, potrs, trtrs
from glovecal_models.regression.profiled_likelihood import NystromFit

SIZES = (4, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 56, 64, 72, 80, 90, 100, 115, 130, 150, 175, 200)
SIZES_WHEN_NEEDED = (250, 300, 350, 400, 450, 500, 550, 600, 700)


@dataclass(frozen=True)
class Reference:
    """The process to be followed at the distinct training inputs, standardised units."""

    mean: np.ndarray
    """Mean without the plane, shape (m,)."""
    variance: np.ndarray
    """Shape (m,)."""
    weights: np.ndarray | None = None
    """Weights (m,) of all training inputs that give ``mean``, where known."""


@dataclass(frozen=True)
class ServedNodes:
    """Nodes for unit signal variance, and how far they are from the reference."""

    pivots: np.ndarray
    """Which distinct inputs are nodes, shape (M,)."""
    weights: np.ndarray
    """(M,), in units of the target."""
    variance_root: np.ndarray
    """(M, r), for unit signal variance."""
    mean_error: float
    """Largest difference of the mean from the reference at a training input."""
    sd_error: float


class NodeChooser:
    """Predictions at the training inputs from the first M pivots, for any M."""

    def __init__(
        self, fit: NystromFit, rows: np.ndarray, pivots: np.ndarray, residual: np.ndarray, scale: float
    ) -> None:
        """``residual`` (p + 1,): the columns' combination that is target minus plane; ``scale``: s^2."""
        self._fit, self._rows, self._pivots, self._scale = fit, rows, pivots, scale
        self._pulled = fit.projected @ residual

    def mean(self, size: int) -> np.ndarray:
        return self._rows[:size].T @ self._solve(size)

    def variance(self, size: int) -> np.ndarray:
        rows = self._rows[:size]
        half = trtrs(self._factor(size), rows, lower=1)[0]
        explained = np.einsum("ij,ij->j", rows, rows)
        left = self._fit.rho * np.einsum("ij,ij->j", half, half)
        return self._scale * np.maximum(1.0 - explained + left, 0.0)

    def reference(self) -> Reference:
        """All pivots: with a factorisation fine enough this is the exact process."""
        return Reference(self.mean(len(self._rows)), self.variance(len(self._rows)))

    def choose(self, reference: Reference, mean_error: float, sd_error: float, most: int) -> int:
        """The smallest offered size within both errors of the reference, else the largest up to ``most``."""
        most = min(most, len(self._rows))
        sizes = [size for size in (*SIZES, *SIZES_WHEN_NEEDED) if size < most] + [most]
        low, high = 0, len(sizes) - 1
        while low < high:
            middle = (low + high) // 2
            if self._close(sizes[middle], reference, mean_error, sd_error):
                high = middle
            else:
                low = middle + 1
        return sizes[low]

    def serve(self, size: int, reference: Reference, acceptable: float) -> ServedNodes:
        """Weights and variance root of the first ``size`` nodes.

        Where these do not give the mean to ``acceptable``, all training inputs become nodes for the mean
        (cost M per frame); the variance, whose cost is M r, stays with the first ``size``.
        """
        pivots = self._pivots[:size]
        corner = np.tril(self._rows[:size, pivots].T)
        weights = trtrs(corner, self._solve(size), lower=1, trans=1)[0]
        values, vectors = np.linalg.eigh(self._fit.gram[:size, :size])
        share = np.maximum(values, 0.0) / (np.maximum(values, 0.0) + self._fit.rho)
        kept = share > 1e-10
        root = trtrs(corner, vectors[:, kept] * np.sqrt(share[kept]), lower=1, trans=1)[0]
        mean_error = float(np.abs(self.mean(size) - reference.mean).max())
        if mean_error > acceptable and reference.weights is not None:
            rest = np.setdiff1d(np.arange(len(reference.weights)), pivots)
            pivots = np.concatenate([pivots, rest])
            weights = reference.weights[pivots]
            root = np.vstack([root, np.zeros((len(rest), root.shape[1]))])
            mean_error = 0.0
        sd_error = float(np.abs(np.sqrt(self.variance(size)) - np.sqrt(reference.variance)).max())
        return ServedNodes(pivots, weights, root, mean_error, sd_error)

    def _close(self, size: int, reference: Reference, mean_error: float, sd_error: float) -> bool:
        if np.abs(self.mean(size) - reference.mean).max() > mean_error:
            return False
        difference = np.sqrt(self.variance(size)) - np.sqrt(reference.variance)
        return bool(np.abs(difference).max() <= sd_error)

    def _factor(self, size: int) -> np.ndarray:
        inner = self._fit.gram[:size, :size].copy()
        inner.ravel()[:: size + 1] += self._fit.rho
        return potrf(inner.T, lower=1, overwrite_a=1, clean=0)[0]

    def _solve(self, size: int) -> np.ndarray:
        return potrs(self._factor(size), self._pulled[:size], lower=1)[0]


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
    diagonal = np.diagonal(values)
    for tolerance in (1e-4, 1e-6, 1e-8):
        least = max(tolerance * float(posterior.noise.min()), 1e-12 * float(diagonal.max()))
        factor = factor_by_rows(values.__getitem__, diagonal, least, len(x) // 2)
        found = _on_pivots(factor, x, posterior)
        to_nodes = values[:, factor.pivots]
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


def _on_pivots(factor: PivotedCholesky, x: np.ndarray, posterior: Posterior) -> FewNodes:
    whitened = factor.rows / np.sqrt(posterior.noise)
    informed, directions = eigh(whitened @ whitened.T, check_finite=False)
    informed = np.maximum(informed, 0.0)
    right = directions.T @ (whitened @ (posterior.residual / np.sqrt(posterior.noise)))
    features = np.column_stack(
        [directions @ (right / (1 + informed)), directions * np.sqrt(informed / (1 + informed))]
    )
    back = solve_triangular(factor.corner(), features, lower=True, trans=1, check_finite=False)
    return FewNodes(x[factor.pivots], back[:, 0], back[:, 1:], np.inf, np.inf)
