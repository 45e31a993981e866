"""The exact marginal likelihood with plane and scale profiled out: O(m^3) for m distinct inputs.

One evaluation is one Cholesky factorisation; its derivatives add one inverse in place, of which only a
triangle is made and read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glovecal_models.regression.lapack_routines import potri, symm, trtrs
from glovecal_models.regression.merged_samples import MergedSamples
from glovecal_models.regression.profiled_likelihood import (
    Derivatives,
    Evaluation,
    Inside,
    Profile,
    cholesky,
    derivatives,
    moved_by_lengthscales,
    profile,
    squared_exponential,
    trace_by_lengthscales,
)


@dataclass(frozen=True)
class TrainingProcess:
    """The exact process at the distinct training inputs, standardised units."""

    profile: Profile
    weights: np.ndarray
    """mean(x) = plane + exp(-|x - x_i|^2 / 2) @ weights, shape (m,)."""
    mean: np.ndarray
    """Mean without the plane, shape (m,)."""
    variance: Callable[[], np.ndarray]
    """Shape (m,); takes twice as long as all the rest. Can be asked for once."""


class ExactProfiledLikelihood:
    """The likelihood of all samples, nothing approximated."""

    def __init__(self, samples: MergedSamples) -> None:
        self._samples = samples
        self._merged = bool((samples.root_count != 1.0).any())

    def evaluate(self, parameters: np.ndarray) -> Evaluation | None:
        """The likelihood at (log lengthscales, log rho) (D + 1,); None where rounding breaks it."""
        points = self._samples.inputs * np.exp(-parameters[:-1])
        evaluated = self._evaluate(parameters)
        if evaluated is None:
            return None
        best, kernel, factor, inside = evaluated
        return Evaluation(best, lambda: self._derivatives(points, kernel, factor, best, inside))

    def _evaluate(self, parameters: np.ndarray) -> tuple[Profile, np.ndarray, np.ndarray, Inside] | None:
        """Profile, unit covariance of the distinct inputs, Cholesky factor and whitened columns."""
        samples = self._samples
        points = samples.inputs * np.exp(-parameters[:-1])
        rho = float(np.exp(parameters[-1]))
        kernel = squared_exponential(points)
        factor = self._factor(kernel, rho)
        if factor is None:
            return None
        whitened = trtrs(factor, samples.columns, lower=1)[0]
        outside = np.zeros((samples.plane_rank + 1, samples.plane_rank + 1))
        outside[-1, -1] = samples.scatter
        gram = whitened.T @ whitened + outside / rho
        log_determinant = 2.0 * float(np.log(factor.diagonal()).sum())
        log_determinant += (samples.total - len(points)) * parameters[-1]
        best = profile(gram, log_determinant, samples.total)
        return best, kernel, factor, Inside(samples.total, rho, whitened, outside)

    def training_process(self, parameters: np.ndarray) -> TrainingProcess | None:
        """The trained process, at its own training inputs; None where rounding breaks it."""
        samples, root = self._samples, self._samples.root_count
        evaluated = self._evaluate(parameters)
        if evaluated is None:
            return None
        best, _, factor, inside = evaluated
        solved = trtrs(factor, inside.columns @ best.residual, lower=1, trans=1)[0]
        mean = (samples.columns @ best.residual - inside.rho * solved) / root

        def variance() -> np.ndarray:
            inverse = potri(factor, lower=1, overwrite_c=1)[0].diagonal()
            left = inside.rho * (1.0 - inside.rho * inverse) / root**2
            return best.scale * np.maximum(left, 0.0)

        return TrainingProcess(best, root * solved, mean, variance)

    def _factor(self, kernel: np.ndarray, rho: float) -> np.ndarray | None:
        root = self._samples.root_count
        inner = kernel * root[:, None] if self._merged else kernel.copy()
        if self._merged:
            inner *= root
        inner.ravel()[:: len(inner) + 1] += rho
        return cholesky(inner)

    def _derivatives(
        self, points: np.ndarray, kernel: np.ndarray, factor: np.ndarray, best: Profile, inside: Inside
    ) -> Derivatives:
        root = self._samples.root_count
        solved = trtrs(factor, inside.columns @ best.residual, lower=1, trans=1)[0]
        moved = root[:, None] * moved_by_lengthscales(kernel, points, root * solved)
        rows = trtrs(factor, np.column_stack([moved, inside.rho * solved]), lower=1)[0]
        return derivatives(best, inside, self._traces(points, kernel, factor, inside.rho), rows)

    def _traces(self, points: np.ndarray, kernel: np.ndarray, factor: np.ndarray, rho: float) -> np.ndarray:
        """trace((K + rho I)^-1 dK); overwrites ``factor`` with the inverse."""
        root = self._samples.root_count
        inverse = potri(factor, lower=1, overwrite_c=1)[0]
        by_noise = rho * float(inverse.diagonal().sum()) + self._samples.total - len(points)
        weighted = inverse.T
        weighted *= kernel
        ones = np.column_stack([root, root[:, None] * points])
        summed = root[:, None] * symm(1.0, weighted.T, ones, lower=1)
        return np.append(trace_by_lengthscales(summed[:, 0], summed[:, 1:], points), by_noise)
