"""Bounded quasi-Newton minimisation from one or several starts, with cancel and progress."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from glovecal_models.errors import Cancelled

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
    cancelled: Callable[[], bool] | None = None,
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
    report: Callable[[str, float], None] | None, sentence: str, low: float, high: float
) -> Callable[[int], None] | None:
    """``on_evaluation`` for a ``report``: from ``low`` towards ``high``, halfway after 30 evaluations.

    How many evaluations a search needs is not known beforehand.
    """
    if report is None:
        return None
    return lambda count: report(
        f"{sentence}, evaluation {count}", low + (high - low) * count / (count + 30.0)
    )
