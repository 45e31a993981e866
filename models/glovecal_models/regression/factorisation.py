"""Pivoted Cholesky of a Gram matrix: K ~ L L' from a few well-chosen points.

The next pivot is the point the present ones explain worst (Fine & Scheinberg 2001; Harbrecht, Peters &
Schneider 2012). For a squared exponential the residual falls faster than any power of the rank, and the
number of points needed does not grow with N (Burt, Rasmussen & van der Wilk 2019). Needs no jitter: it stops
before rounding matters. Rows of K are asked for as they are needed: LAPACK's ``pstrf`` wants the whole matrix
and knows no largest rank, which takes 50 times as long for 2000 samples of one sensor.

The LAPACK and BLAS routines that trainers call directly: in place, one triangle, no checks per call.

scipy's wrappers copy, check for NaN and symmetrise at each call, which costs as much as the arithmetic on
matrices of some dozen rows. Inputs were checked once by ``check_samples``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

gesdd, posv, potrf, potri, potrs, trtrs = get_lapack_funcs(
    ("gesdd", "posv", "potrf", "potri", "potrs", "trtrs"), dtype=np.float64
)
ger, symm, syrk, trmm, trsm = get_blas_funcs(("ger", "symm", "syrk", "trmm", "trsm"), dtype=np.float64)


@dataclass(frozen=True)
class PivotedCholesky:
    """K ~ rows.T @ rows; exact at the pivots."""

    rows: np.ndarray
    """Shape (r, N): L transposed, so that a new pivot reads contiguous memory."""
    pivots: np.ndarray
    """Indices of the chosen points in the order chosen, shape (r,)."""
    residual: np.ndarray
    """Diagonal of K - L L', shape (N,), not negative."""
    complete: bool
    """False when the largest rank allowed was reached before the tolerance."""

    @property
    def rank(self) -> int:
        return len(self.pivots)

    def corner(self) -> np.ndarray:
        """Lower triangular factor (r, r) of the pivots' own Gram matrix."""
        return np.tril(self.rows[:, self.pivots].T)


def pivoted_cholesky(points: np.ndarray, tolerance: float, largest_rank: int) -> PivotedCholesky:
    """Factor the unit squared-exponential Gram matrix of ``points`` (N, D), inputs over lengthscales.

    Stops when no diagonal entry of the residual exceeds ``tolerance`` (of a unit diagonal).
    """
    half_norm = -0.5 * np.einsum("ij,ij->i", points, points)

    def row(pivot: int) -> np.ndarray:
        values = points @ points[pivot]
        values += half_norm
        values += half_norm[pivot]
        return np.exp(values, out=values)

    return factor_by_rows(row, np.ones(len(points)), tolerance, largest_rank)


def factor_by_rows(
    row: Callable[[int], np.ndarray], diagonal: np.ndarray, tolerance: float, largest_rank: int
) -> PivotedCholesky:
    """Factor the Gram matrix with ``diagonal`` (N,), whose row (N,) of a point ``row`` tells when asked."""
    residual, count = diagonal.copy(), len(diagonal)
    largest_rank = min(largest_rank, count)
    rows = np.empty((min(largest_rank, 128), count))
    pivots = np.empty(largest_rank, dtype=np.intp)
    rank = 0
    while rank < largest_rank:
        pivot = int(residual.argmax())
        if residual[pivot] <= tolerance:
            break
        if rank == len(rows):
            rows = np.concatenate([rows, np.empty((min(rank, largest_rank - rank), count))])
        new = rows[rank]
        new[:] = row(pivot)
        if rank:
            new -= rows[:rank, pivot] @ rows[:rank]
        new *= 1.0 / np.sqrt(residual[pivot])
        residual -= new * new
        np.maximum(residual, 0.0, out=residual)
        residual[pivot] = 0.0
        pivots[rank] = pivot
        rank += 1
    complete = rank == count or float(residual.max()) <= tolerance
    return PivotedCholesky(rows[:rank], pivots[:rank].copy(), residual, complete)
