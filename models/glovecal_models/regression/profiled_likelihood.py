"""What exact and low-rank likelihoods share: plane and scale profiled out of the marginal likelihood.

Model of Wang & Neff (2013), equations 7, 8 and 11, in standardised units:
y ~ N(H b, s^2 (k_theta + rho I)). For given theta (log lengthscales) and log rho the best b is generalised
least squares and the best s^2 is the mean weighted residual (Rasmussen & Williams 2006, section 2.7, in the
limit of no prior on b), which leaves D + 1 parameters to search instead of 3 D + 3.

Both work on S K S + rho I "inside" a space of small dimension; what lies "outside" it (scatter of merged
samples, directions no node reaches) sees only the noise rho I and enters through a Gram matrix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glovecal_models.regression.lapack_routines import posv, potrf

LOG_2_PI = float(np.log(2.0 * np.pi))
SMALLEST_SCALE = 1e-20
"""Reached only by targets that are a plane to all digits."""

Derivatives = tuple[np.ndarray, np.ndarray]
"""Gradient (D + 1,) by log lengthscales and log rho, and average information (D + 1, D + 1)."""


@dataclass(frozen=True)
class Profile:
    """The likelihood at the best plane and scale."""

    nlml: float
    scale: float
    """s^2: signal variance, standardised units squared."""
    plane: np.ndarray
    """Coefficients of the plane's basis, shape (p,)."""
    residual: np.ndarray
    """Combination of the columns that is the residual: [-plane, 1], shape (p + 1,)."""
    gram: np.ndarray
    """columns' (K + rho I)^-1 columns, shape (p + 1, p + 1)."""


@dataclass(frozen=True)
class Evaluation:
    """The likelihood at one point; derivatives are computed when asked for, once at most."""

    profile: Profile
    derivatives: Callable[[], Derivatives]

    @property
    def nlml(self) -> float:
        return self.profile.nlml


def profile(gram: np.ndarray, log_determinant: float, total: float) -> Profile:
    """From columns' K^-1 columns (p+1, p+1) of [basis, target], log |K + rho I| and N."""
    p = len(gram) - 1
    _, plane, info = posv(gram[:p, :p], gram[:p, p])
    if info != 0:
        plane = np.linalg.lstsq(gram[:p, :p], gram[:p, p], rcond=None)[0]
    residual = np.append(-plane, 1.0)
    scale = max(float(residual @ gram @ residual) / total, SMALLEST_SCALE)
    nlml = 0.5 * (total * (np.log(scale) + 1.0 + LOG_2_PI) + log_determinant)
    return Profile(float(nlml), scale, plane, residual, gram)


def moved_by_lengthscales(kernel: np.ndarray, points: np.ndarray, pulled: np.ndarray) -> np.ndarray:
    """(dK / d log l_d) pulled for each d, shape (r, D); ``points`` (r, D) are inputs over lengthscales.

    dK_ij / d log l_d = K_ij (x_id - x_jd)^2, expanded so that K is read once.
    """
    dimensions = points.shape[1]
    squares = points * points
    column = pulled[:, None]
    moments = kernel @ np.column_stack([column, points * column, squares * column])
    once, twice = moments[:, 1 : 1 + dimensions], moments[:, 1 + dimensions :]
    return squares * moments[:, :1] - 2.0 * points * once + twice


def trace_by_lengthscales(sums: np.ndarray, crossed: np.ndarray, points: np.ndarray) -> np.ndarray:
    """sum_ij M_ij (x_id - x_jd)^2 for each d, from M's row sums and M @ points, M symmetric."""
    return 2.0 * (sums @ (points * points) - np.einsum("ij,ij->j", points, crossed))


@dataclass(frozen=True)
class Inside:
    """What derivatives need from either likelihood, apart from traces."""

    total: float
    rho: float
    columns: np.ndarray
    """Whitened columns inside, shape (r, p + 1)."""
    outside: np.ndarray
    """Gram matrix of the columns outside, shape (p + 1, p + 1)."""


def derivatives(best: Profile, inside: Inside, traces: np.ndarray, moved: np.ndarray) -> Derivatives:
    """Gradient and average information (Gilmour, Thompson & Cullis 1995), scale profiled.

    ``traces``: trace(K^-1 dK) by each parameter, shape (D + 1,). ``moved``: whitened dK K^-1 residual
    inside, shape (r, D + 1). The average information is the mean of observed and expected information,
    costs one more solve with D + 1 right-hand sides, and is never indefinite.
    """
    rho, v, p = inside.rho, best.residual, len(best.plane)
    products = moved.T @ moved
    with_columns = moved.T @ inside.columns
    noise = inside.outside @ v / rho
    with_columns[-1] += noise
    products[-1, -1] += float(v @ noise)
    with_residual = with_columns @ v
    gradient = 0.5 * (traces - with_residual / best.scale)
    across = with_columns[:, :p]
    projected = products - across @ np.linalg.lstsq(best.gram[:p, :p], across.T, rcond=None)[0]
    projected -= np.outer(with_residual, with_residual) / (inside.total * best.scale)
    return gradient, projected / (2.0 * best.scale)


def squared_exponential(points: np.ndarray) -> np.ndarray:
    """exp(-|x_i - x_j|^2 / 2), shape (r, r), of inputs over lengthscales."""
    half_norm = -0.5 * np.einsum("ij,ij->i", points, points)
    gram = points @ points.T
    gram += half_norm[:, None]
    gram += half_norm[None, :]
    np.minimum(gram, 0.0, out=gram)
    return np.exp(gram, out=gram)


def cholesky(matrix: np.ndarray) -> np.ndarray | None:
    """Lower Cholesky factor of a symmetric matrix, overwriting it; None if it is not positive definite.

    A C-ordered symmetric matrix is its own Fortran-ordered transpose: no copy is made.
    """
    factor, info = potrf(matrix.T, lower=1, overwrite_a=1, clean=0)
    return factor if info == 0 else None
