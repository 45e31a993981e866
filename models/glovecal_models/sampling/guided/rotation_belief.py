"""What is believed of one rotation's calibration: a process over readings, plane included.

The paper's covariance (Wang & Neff 2013, equation 8) with a plane so wide that data alone decide it. Unlike a
trained regressor a belief knows how its errors in different frames go together: a wrong gain is wrong in
every frame. That is what lets fingertips that touch in many frames correct it (``touch_posterior.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_solve, cholesky

Shape = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Covariance (N, M), degrees squared, of what is not a plane, at inputs (N, D) and (M, D) in shares."""


@dataclass(frozen=True)
class Prior:
    """Before any sample; inputs in shares of the sensor's range, about its middle."""

    sensors: tuple[str, ...]
    middle: np.ndarray
    """(D,), counts."""
    span: np.ndarray
    """(D,), counts."""
    slope_deg: np.ndarray
    """(D,), mean slope over the range."""
    mean_deg: float
    """In the middle of the range."""
    offset_sd_deg: float
    slope_sd_deg: float
    shape: Shape
    follows: dict[str, float] = field(default_factory=dict)
    """Weights of the rotations that it follows; the belief is then of what the rule misses."""
    frame_sd_deg: float = 0.6
    """What is new in each frame: sensors' noise, or a joint that no sensor reads."""

    def inputs(self, readings: np.ndarray) -> np.ndarray:
        """Of raw counts (N, D)."""
        return (readings - self.middle) / self.span

    def mean(self, x: np.ndarray) -> np.ndarray:
        return self.mean_deg + x @ self.slope_deg

    def covariance(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        return self.offset_sd_deg**2 + self.slope_sd_deg**2 * (x @ z.T) + self.shape(x, z)


class RotationBelief:
    """``prior`` after samples: readings (N, D) raw counts, angles (N,) and their errors (N,), degrees."""

    def __init__(self, prior: Prior, readings: np.ndarray, angles: np.ndarray, sd: np.ndarray) -> None:
        self.prior = prior
        self.samples = len(angles)
        self._x = prior.inputs(readings)
        self._root = cholesky(prior.covariance(self._x, self._x) + np.diag(sd**2), lower=True)
        self._weights = cho_solve((self._root, True), angles - prior.mean(self._x))

    def mean(self, readings: np.ndarray) -> np.ndarray:
        """(N,), degrees, at raw counts (N, D)."""
        x = self.prior.inputs(readings)
        return self.prior.mean(x) + self.prior.covariance(x, self._x) @ self._weights

    def covariance(self, readings: np.ndarray, others: np.ndarray) -> np.ndarray:
        """(N, M), degrees squared, of the errors at two sets of raw counts."""
        x, z = self.prior.inputs(readings), self.prior.inputs(others)
        explained = self.prior.covariance(x, self._x) @ cho_solve(
            (self._root, True), self.prior.covariance(self._x, z)
        )
        return self.prior.covariance(x, z) - explained

    def variance(self, readings: np.ndarray) -> np.ndarray:
        """(N,): the diagonal of ``covariance``."""
        blocks = [readings[start : start + 200] for start in range(0, len(readings), 200)]
        diagonals = [np.diag(self.covariance(block, block)) for block in blocks]
        return np.maximum(np.concatenate([np.empty(0), *diagonals]), 0.0)
