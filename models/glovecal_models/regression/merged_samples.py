"""Training samples with equal inputs merged: exact for the likelihood, and what 8-bit sensors need.

n samples at one input with noise variance s^2 carry the same information about the function as their mean
with noise s^2 / n, plus their scatter about it. Written with rows multiplied by sqrt(n) the noise stays
uniform: S K S + s^2 I, S = diag(sqrt(n)). A single bend sensor has 120 distinct values in 2000 samples.

Counts need not be whole: where neighbouring samples repeat each other's errors, each counts as a part of
one (its likelihood to that power: Pauli, Racugno & Ventura 2011, composite likelihoods), and two equal
samples that count a half each are one.

Samples may differ in precision, too: one of noise variance s^2 / p enters as p of them would, but is one in
number. With a geometric mean of p of 1 the likelihood keeps its value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.regression.lapack_routines import gesdd

RANK_TOLERANCE = 1e-10
"""Directions of [inputs 1] with less than this share of the largest are no part of the plane."""


@dataclass(frozen=True)
class MergedSamples:
    """Distinct inputs and, per input, sqrt(count) times the plane's basis and the mean target."""

    inputs: np.ndarray
    """Distinct inputs, shape (m, D), standardised."""
    root_count: np.ndarray
    """Square root of what the samples at each input count, times their precision, shape (m,)."""
    columns: np.ndarray
    """sqrt(count) * [basis of the plane, mean target], shape (m, p + 1)."""
    total: float
    """What all samples count: their number before merging, times their weight."""
    scatter: float
    """Sum of squares, by weight and precision, of the targets about the mean target of their input."""
    to_plane: np.ndarray
    """basis = [inputs 1] @ to_plane, shape (D + 1, p); p < D + 1 for collinear inputs."""
    first: np.ndarray
    """For each distinct input the first sample that has it, shape (m,), int."""

    @property
    def plane_rank(self) -> int:
        return self.columns.shape[1] - 1

    @classmethod
    def of(
        cls,
        inputs: np.ndarray,
        target: np.ndarray,
        weight: float = 1.0,
        precision: np.ndarray | None = None,
    ) -> MergedSamples:
        """Merge ``inputs`` (N, D) and ``target`` (N,), both standardised; each sample counts ``weight``.

        ``precision`` (N,), geometric mean 1: of each sample's noise, relative; None: all alike.
        """
        order = np.lexsort(inputs.T[::-1])
        ordered = inputs[order]
        starts = np.flatnonzero(np.r_[True, (ordered[1:] != ordered[:-1]).any(axis=1)])
        counts = np.diff(np.r_[starts, len(order)])
        distinct = np.ascontiguousarray(ordered[starts])
        shares = np.ones(len(order)) if precision is None else precision[order]
        together = counts if precision is None else np.add.reduceat(shares, starts)
        means = np.add.reduceat(shares * target[order], starts) / together
        scatter = weight * float(np.sum(shares * (target[order] - np.repeat(means, counts)) ** 2))
        root = np.sqrt(weight * together)
        basis, to_plane = _plane_basis(distinct, root)
        columns = np.column_stack([basis, root * means])
        first = np.minimum.reduceat(order, starts)
        return cls(distinct, root, columns, weight * len(target), scatter, to_plane, first)


def _plane_basis(inputs: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal basis (m, p) of sqrt(n) [inputs 1], and the map from [inputs 1] to it."""
    design = root[:, None] * np.column_stack([inputs, np.ones(len(inputs))])
    u, s, vt, _ = gesdd(design, full_matrices=0)
    kept = s > RANK_TOLERANCE * s[0]
    return u[:, kept], vt[kept].T / s[kept]
