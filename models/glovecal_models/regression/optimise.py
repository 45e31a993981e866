"""Bounded minimisation with cancel and progress: L-BFGS of any objective, Newton of profiled likelihoods.

Newton steps use the average information matrix. It replaces second derivatives and is never indefinite, so a
handful of evaluations is enough where L-BFGS takes twenty or more. Where the model is wrong (an input is
missing) the matrix is a poor Hessian: the last gradient changes correct it by BFGS updates. Steps are damped
after Levenberg and Marquardt and kept inside bounds. The fall the quadratic model expects, in nats, is the
natural measure of "converged".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from glovecal_models.errors import Cancelled
from glovecal_models.progress import Cancel, Report, stop_if
from glovecal_models.regression.profiled_likelihood import Evaluation

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

Objective = Callable[[np.ndarray], tuple[float, np.ndarray]]
"""Parameters (P,) -> value and gradient (P,). May raise LinAlgError where it cannot be computed."""

_UNREACHABLE = 1e10


@dataclass
class Optimum:
    """Where a minimisation ended; with several starts, the best of them."""

    parameters: np.ndarray
    value: float
    evaluations: int
    start_values: list[float] = field(default_factory=list)
    """The value each start ended at, in the order of the starts."""


def minimise(
    objective: Objective,
    starts: Sequence[np.ndarray],
    bounds: Sequence[tuple[float, float]],
    *,
    iterations: int = 200,
    least_gain: float = 1e-6,
    cancelled: Cancel | None = None,
    on_evaluation: Callable[[int], None] | None = None,
) -> Optimum:
    """L-BFGS-B from every start: ``iterations`` iterations, fewer once one gains less than ``least_gain``.

    ``cancelled`` is asked before every evaluation (raises Cancelled); ``on_evaluation`` gets the number
    of evaluations so far, over all starts. Raises LinAlgError if no start could be evaluated at all.
    """
    from scipy.optimize import minimize  # here, because what only predicts need not wait for it

    count = 0
    best_value, best_parameters, last_value = np.inf, np.empty(0), np.inf

    def evaluate(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        nonlocal count, best_value, best_parameters
        if cancelled is not None and cancelled():
            raise Cancelled(f"training was stopped after {count} evaluations")
        count += 1
        if on_evaluation is not None:
            on_evaluation(count)
        try:
            value, gradient = objective(parameters)
        except np.linalg.LinAlgError:
            return _UNREACHABLE, np.zeros(len(parameters))
        if not np.isfinite(value) or not np.isfinite(gradient).all():
            return _UNREACHABLE, np.zeros(len(parameters))
        if value < best_value:
            best_value, best_parameters = value, parameters.copy()
        return value, gradient

    def stop_when_gains_are_small(intermediate_result: OptimizeResult) -> None:
        nonlocal last_value
        gain, last_value = last_value - float(intermediate_result.fun), float(intermediate_result.fun)
        if gain < least_gain:
            raise StopIteration

    lower, upper = np.array(bounds, dtype=float).T
    ends = []
    for start in starts:
        last_value = np.inf
        outcome = minimize(
            evaluate,
            np.clip(start, lower, upper),
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            callback=stop_when_gains_are_small,
            options={"maxiter": iterations, "maxcor": 20, "ftol": 0.0, "gtol": 1e-5},
        )
        ends.append(float(outcome.fun))
    if not np.isfinite(best_value):
        raise np.linalg.LinAlgError("the objective could not be evaluated at any start")
    return Optimum(best_parameters, float(best_value), count, ends)


def counted_progress(
    report: Report | None, sentence: str, low: float, high: float
) -> Callable[[int], None] | None:
    """``on_evaluation`` for a ``report``: from ``low`` towards ``high``, halfway after 30 evaluations.

    How many evaluations a search needs is not known beforehand.
    """
    if report is None:
        return None
    return lambda count: report(
        f"{sentence}, evaluation {count}", low + (high - low) * count / (count + 30.0)
    )


LONGEST_STEP = 1.5
"""In natural logarithms: no lengthscale changes more than 4.5-fold at once."""


@dataclass(frozen=True)
class SearchResult:
    """Where a search ended."""

    parameters: np.ndarray
    nlml: float
    evaluations: int


def newton_search(
    evaluate: Callable[[np.ndarray], Evaluation | None],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    tolerance: float,
    evaluations: int,
    cancelled: Cancel | None = None,
) -> SearchResult | None:
    """Search from ``start`` until less than ``tolerance`` nats are expected or ``evaluations`` are used up.

    None when the likelihood cannot be evaluated at the start. Raises Cancelled.
    """
    point = np.clip(start, lower, upper)
    current = evaluate(point)
    if current is None:
        return None
    used, damping = 1, 1e-2
    gradient, information = current.derivatives()
    secants: list[tuple[np.ndarray, np.ndarray]] = []
    while used < evaluations:
        stop_if(cancelled, "training")
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
    return SearchResult(point, current.nlml, used)


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
