"""Bounds on the exact likelihood that never touch the N x N matrix.

With K = Q + E, Q = L L' from pivoted Cholesky, E positive semidefinite with trace t in units of the signal
variance s^2, and noise rho s^2:

    log|Q + rho I| <= log|K + rho I| <= log|Q + rho I| + t / rho              (Titsias 2009, equation 9)
    r' (Q + (rho + t) I)^-1 r <= r' (K + rho I)^-1 r <= r' (Q + rho I)^-1 r   (largest eigenvalue of E <= t)

So the exact NLML at given hyperparameters lies in a bracket that tightens as pivots are added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.regression.lapack_routines import potrf, trtrs
from glovecal_models.regression.merged_samples import MergedSamples
from glovecal_models.regression.profiled_likelihood import LOG_2_PI, Profile, profile


@dataclass(frozen=True)
class Certificate:
    """The exact NLML (standardised units, scale and plane as given) is in [lower, upper]."""

    lower: float
    upper: float
    how: str
    """``trace bounds`` or ``exact evaluation``."""

    @property
    def width(self) -> float:
        return self.upper - self.lower


class NystromFit:
    """Plane, scale and likelihood of K ~ L L' for fixed lengthscales; any leading part of L."""

    def __init__(self, samples: MergedSamples, rows: np.ndarray, rho: float) -> None:
        """``rows`` (r, m): L transposed, unit signal variance, one column per distinct input."""
        self.samples, self.rho = samples, rho
        self.scaled = rows * samples.root_count
        self.gram = self.scaled @ self.scaled.T
        self.projected = self.scaled @ samples.columns
        self._columns = samples.columns.T @ samples.columns
        self._columns[-1, -1] += samples.scatter

    def profile(self) -> Profile:
        gram, log_determinant = self.inverse_gram(self.rho)
        return profile(gram, log_determinant, self.samples.total)

    def inverse_gram(self, noise: float) -> tuple[np.ndarray, float]:
        """columns' (L L' + noise I)^-1 columns, and log |L L' + noise I|."""
        rank = len(self.gram)
        inner = self.gram.copy()
        inner.ravel()[:: rank + 1] += noise
        factor, info = potrf(inner.T, lower=1, overwrite_a=1, clean=0)
        if info != 0:
            raise ArithmeticError(f"low-rank factor of rank {rank} is not positive definite at {noise:g}")
        half = trtrs(factor, self.projected, lower=1)[0]
        log_determinant = 2.0 * float(np.log(factor.diagonal()).sum())
        log_determinant += (self.samples.total - rank) * np.log(noise)
        return (self._columns - half.T @ half) / noise, log_determinant


def certify(fit: NystromFit, trace: float, plane: np.ndarray, scale: float) -> Certificate:
    """Bracket the exact NLML at rho, ``plane`` and ``scale`` (s^2); ``trace`` = trace of E, weighted."""
    residual = np.append(-plane, 1.0)
    total, rho = fit.samples.total, fit.rho
    gram, log_determinant = fit.inverse_gram(rho)
    shifted, _ = fit.inverse_gram(rho + trace)
    constant = total * (LOG_2_PI + np.log(scale)) + log_determinant
    upper = 0.5 * (constant + trace / rho + float(residual @ gram @ residual) / scale)
    lower = 0.5 * (constant + float(residual @ shifted @ residual) / scale)
    return Certificate(lower, upper, "trace bounds")
