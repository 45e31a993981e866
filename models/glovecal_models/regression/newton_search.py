"""Minimise a profiled likelihood by Newton steps with the average information matrix.

The matrix replaces second derivatives and is never indefinite, so a handful of evaluations is enough where
L-BFGS takes twenty or more. Where the model is wrong (an input is missing) the matrix is a poor Hessian:
the last gradient changes correct it by BFGS updates. Steps are damped after Levenberg and Marquardt and kept
inside bounds. The fall the quadratic model expects, in nats, is the natural measure of "converged".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import Cancelled
from glovecal_models.regression.profiled_likelihood import Evaluation

LONGEST_STEP = 1.5
"""In natural logarithms: no lengthscale changes more than 4.5-fold at once."""


@dataclass(frozen=True)
class SearchResult:
    """Where a search ended."""

    parameters: np.ndarray
    nlml: float
    evaluations: int
    expected_fall: float
    """Nats that one more step promises."""


def newton_search(
    evaluate: Callable[[np.ndarray], Evaluation | None],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    tolerance: float,
    evaluations: int,
    cancelled: Callable[[], bool] | None = None,
) -> SearchResult | None:
    """Search from ``start`` until less than ``tolerance`` nats are expected or ``evaluations`` are used up.

    None when the likelihood cannot be evaluated at the start. Raises Cancelled.
    """
    point = np.clip(start, lower, upper)
    current = evaluate(point)
    if current is None:
        return None
    used, damping, expected = 1, 1e-2, np.inf
    gradient, information = current.derivatives()
    secants: list[tuple[np.ndarray, np.ndarray]] = []
    while used < evaluations:
        if cancelled is not None and cancelled():
            raise Cancelled("training was cancelled")
        step, expected = _step(point, gradient, _corrected(information, secants), damping, lower, upper)
        if expected < tolerance:
            break
        trial = np.clip(point + step, lower, upper)
        candidate = evaluate(trial)
        used += 1
        fall = current.nlml - candidate.nlml if candidate is not None else -np.inf
        if candidate is not None and fall > 1e-4 * expected:
            previous = gradient
            gradient, information = candidate.derivatives()
            secants = [*secants[-2:], (trial - point, gradient - previous)]
            point, current = trial, candidate
            damping = max(damping * (0.1 if fall > 0.5 * expected else 0.7), 1e-6)
        else:
            damping = max(damping * 8.0, 1e-1)
            if damping > 1e8:
                break
    return SearchResult(point, current.nlml, used, float(expected))


def _corrected(information: np.ndarray, secants: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """BFGS updates of ``information`` by (step, change of gradient), oldest first; stays positive."""
    matrix = information + 1e-9 * np.eye(len(information))
    for step, change in secants:
        along, moved = float(step @ change), matrix @ step
        curvature = float(step @ moved)
        if along > 0.1 * curvature > 0.0:
            matrix = matrix - np.outer(moved, moved / curvature) + np.outer(change, change / along)
    return matrix


def _step(
    point: np.ndarray,
    gradient: np.ndarray,
    information: np.ndarray,
    damping: float,
    lower: np.ndarray,
    upper: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Damped step inside the bounds, and the fall the quadratic model expects of it.

    A parameter the step would push over its bound goes to the bound and the others are solved again.
    """
    scale = information.diagonal() + 1e-3 * max(float(information.diagonal().max()), 1e-3)
    matrix = information + np.diag(damping * scale)
    step = np.zeros(len(point))
    free = ~(((point <= lower) & (gradient > 0)) | ((point >= upper) & (gradient < 0)))
    while free.any():
        rest = gradient[free] + matrix[np.ix_(free, ~free)] @ step[~free]
        step[free] = -np.linalg.solve(matrix[np.ix_(free, free)], rest)
        over = free & ((point + step < lower) | (point + step > upper))
        if not over.any():
            break
        step[over] = np.clip(point + step, lower, upper)[over] - point[over]
        free &= ~over
    step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-300))
    expected = -(gradient @ step + 0.5 * step @ information @ step)
    return step, max(float(expected), 0.0)
