"""Pivoted Cholesky of a squared-exponential Gram matrix: K ~ L L' from a few well-chosen points.

The next pivot is the point the present ones explain worst (Fine & Scheinberg 2001; Harbrecht, Peters &
Schneider 2012). For this kernel the residual falls faster than any power of the rank, and the number of
points needed does not grow with N (Burt, Rasmussen & van der Wilk 2019). Needs no jitter: it stops before
rounding matters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PivotedCholesky:
    """exp(-|x_i - x_j|^2 / 2) ~ rows.T @ rows; exact at the pivots."""

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

    def corner(self, rank: int | None = None) -> np.ndarray:
        """Lower triangular factor (r, r) of the pivots' own Gram matrix, leading ``rank`` rows."""
        rank = self.rank if rank is None else rank
        return np.tril(self.rows[:rank, self.pivots[:rank]].T)


def pivoted_cholesky(points: np.ndarray, tolerance: float, largest_rank: int) -> PivotedCholesky:
    """Factor the unit squared-exponential Gram matrix of ``points`` (N, D), inputs over lengthscales.

    Stops when no diagonal entry of the residual exceeds ``tolerance`` (of a unit diagonal).
    """
    count = len(points)
    largest_rank = min(largest_rank, count)
    rows = np.empty((min(largest_rank, 128), count))
    residual = np.ones(count)
    pivots = np.empty(largest_rank, dtype=np.intp)
    half_norm = -0.5 * np.einsum("ij,ij->i", points, points)
    rank = 0
    while rank < largest_rank:
        pivot = int(residual.argmax())
        if residual[pivot] <= tolerance:
            break
        if rank == len(rows):
            rows = np.concatenate([rows, np.empty((min(rank, largest_rank - rank), count))])
        row = rows[rank]
        np.matmul(points, points[pivot], out=row)
        row += half_norm
        row += half_norm[pivot]
        np.exp(row, out=row)
        if rank:
            row -= rows[:rank, pivot] @ rows[:rank]
        row *= 1.0 / np.sqrt(residual[pivot])
        residual -= row * row
        np.maximum(residual, 0.0, out=residual)
        residual[pivot] = 0.0
        pivots[rank] = pivot
        rank += 1
    complete = rank == count or float(residual.max()) <= tolerance
    return PivotedCholesky(rows[:rank], pivots[:rank].copy(), residual, complete)
