"""A rotation's process after samples: its mean, its variance, and how much that falls with more.

With samples at X, whose errors have the covariance N, the variance at u is

    v(u) = k(u, u) - k(u, X) (K + N)^-1 k(X, u)

and further samples at C, of error covariance M, lower it by g (S + M)^-1 g', where g and S are the
covariances (after X) of u with C and of C with itself (Rasmussen & Williams 2006, equation 2.24; the mean of
the fall over many u is the criterion of Cohn 1996). No target is needed for it. The mean, which needs one, is
that of the assumed processes: with the few samples of a beginning it may be nearer the truth than a trained
process, whose hyperparameters follow the steps' own errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular

from glovecal_models.layout import Correspondence, Layout
from glovecal_models.sampling.active.assumed_process import AssumedProcess, assumed_process
from glovecal_models.sampling.active.known_readings import KnownBlock, KnownReadings


@dataclass(frozen=True)
class SampledPoints:
    """Of one step."""

    points: np.ndarray
    """Inputs in the process' units, shape (m, D + 1)."""
    errors: np.ndarray
    """Covariance of the errors, shape (m, m), degrees squared."""
    target: np.ndarray = field(default_factory=lambda: np.empty(0))
    """Degrees, shape (m,); empty for a step that was not recorded yet."""


def step_errors(rows: int, samples: float, noise_sd_deg: float, shared_sd_deg: float) -> np.ndarray:
    """Error covariance (m, m) of ``rows`` that stand for ``samples`` and have one error in common."""
    own = noise_sd_deg**2 * rows / max(samples, 1.0)
    return own * np.eye(rows) + shared_sd_deg**2


def sampled_points(
    block: KnownBlock, item: Correspondence, process: AssumedProcess, sensors: tuple[str, ...]
) -> SampledPoints:
    """What ``block`` knows of the rotation; no points where it was not measured."""
    angle = block.angles.get(item.rotation, np.full(len(block.readings), np.nan))
    rows = np.isfinite(angle)
    points = process.unit(item.input_columns(block.readings[rows], sensors))
    samples = block.samples * rows.mean()
    errors = step_errors(len(points), samples, process.noise_sd_deg, block.shared_sd_deg)
    return SampledPoints(points, errors, angle[rows])


class PosteriorVariance:
    """Of one rotation, at the points ``u`` (U, D + 1) where it will be used."""

    def __init__(self, process: AssumedProcess, u: np.ndarray, sampled: Sequence[SampledPoints]) -> None:
        self._process, self._u = process, u
        self._points = np.concatenate([np.empty((0, u.shape[1])), *(each.points for each in sampled)])
        self._lower = self._root([each.errors for each in sampled])
        self._white = self._whitened(u)
        self.variance = np.maximum(process.alone(u) - (self._white**2).sum(axis=0), 0.0)
        """At u, shape (U,), degrees squared, without the noise of a frame."""

    def fall(self, more: SampledPoints) -> np.ndarray:
        """By how much the variance at u falls, shape (U,), with ``more`` samples."""
        white = self._whitened(more.points)
        between = self._process.between(self._u, more.points) - self._white.T @ white
        inside = self._process.between(more.points, more.points) - white.T @ white + more.errors
        return np.einsum("um,mu->u", between, cho_solve(cho_factor(inside, lower=True), between.T))

    def _root(self, errors: Sequence[np.ndarray]) -> np.ndarray:
        """Lower root of K + N."""
        if not len(self._points):
            return np.empty((0, 0))
        matrix = self._process.between(self._points, self._points) + block_diag(*errors)
        return np.linalg.cholesky(matrix)

    def _whitened(self, points: np.ndarray) -> np.ndarray:
        if not len(self._points):
            return np.empty((0, len(points)))
        to_points = self._process.between(self._points, points)
        return solve_triangular(self._lower, to_points, lower=True, check_finite=False)


def assumed_angles(layout: Layout, known: KnownReadings, readings: np.ndarray) -> dict[str, np.ndarray]:
    """Degrees (N,) by rotation that ``known`` has samples of, at ``readings`` (N, S), counts."""
    measured = {rotation for block in known.blocks for rotation in block.angles}
    angles = {}
    for item in layout.correspondences:
        if item.simulated is None and item.rotation in measured:
            process = assumed_process(item, known.low, known.high, known.sensors)
            angles[item.rotation] = _mean(process, item, known, readings)
    return angles


def _mean(
    process: AssumedProcess, item: Correspondence, known: KnownReadings, readings: np.ndarray
) -> np.ndarray:
    sampled = [sampled_points(block, item, process, known.sensors) for block in known.blocks]
    points = np.concatenate([each.points for each in sampled])
    target = np.concatenate([each.target for each in sampled])
    matrix = process.between(points, points) + block_diag(*(each.errors for each in sampled))
    middle = float(target.mean())
    weights = np.linalg.solve(matrix, target - middle)
    return (
        middle + process.between(process.unit(item.input_columns(readings, known.sensors)), points) @ weights
    )
