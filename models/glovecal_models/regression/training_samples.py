"""Samples as trainers need them: checked, with a sentence a user can act on, then standardised.

Training samples with equal inputs merged: exact for the likelihood, and what 8-bit sensors need.

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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import NotTrainable
from glovecal_models.regression.factorisation import gesdd

_RELATIVE_STILLNESS = 1e-12
MOST_NAMED = 8
"""Sensors; more are counted."""
RANK_TOLERANCE = 1e-10
"""Directions of [inputs 1] with less than this share of the largest are no part of the plane."""


def check_samples(
    inputs: np.ndarray,
    target: np.ndarray,
    sensor_names: Sequence[str] | None = None,
    *,
    least: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return inputs (N, D) and target (N,) as float64, or raise NotTrainable.

    ``least`` is the smallest usable number of samples (default: 3 (D + 1), at least 10).
    Duplicate and collinear rows are welcome: 8-bit sensors always give them.
    """
    inputs, target = _as_numbers(inputs, "readings"), _as_numbers(target, "reference angles")
    if inputs.ndim != 2 or target.shape != inputs.shape[:1] or inputs.shape[1] == 0:
        raise NotTrainable(
            f"readings have shape {inputs.shape} and reference angles {target.shape}; "
            "expected (N, D) with at least one sensor, and (N,)"
        )
    names = _names(sensor_names, inputs.shape[1])
    _check_finite(inputs, target, names)
    _check_enough(len(target), inputs.shape[1], least)
    _check_moving(inputs, names)
    if _is_still(target):
        raise NotTrainable(
            f"the reference angle is {target[0]:g} degrees in all {len(target)} samples; "
            "a map can only be learned from a joint that moves"
        )
    return inputs, target


def _as_numbers(values: np.ndarray, what: str) -> np.ndarray:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise NotTrainable(f"{what} are not numbers, or not one for each sample") from None


def _names(sensor_names: Sequence[str] | None, dimensions: int) -> list[str]:
    if sensor_names is None:
        return [f"number {column}" for column in range(1, dimensions + 1)]
    if len(sensor_names) != dimensions:
        raise NotTrainable(f"{len(sensor_names)} sensor names for {dimensions} columns of readings")
    return list(sensor_names)


def _check_finite(inputs: np.ndarray, target: np.ndarray, names: list[str]) -> None:
    bad = np.argwhere(~np.isfinite(inputs))
    if len(bad):
        row, column = bad[0]
        raise NotTrainable(
            f"sensor {names[column]} reads {inputs[row, column]} in sample {row + 1}; "
            f"{len(bad)} of {inputs.size} readings are not finite, training needs all of them"
        )
    bad_rows = np.flatnonzero(~np.isfinite(target))
    if len(bad_rows):
        raise NotTrainable(
            f"the reference angle is {target[bad_rows[0]]} in sample {bad_rows[0] + 1}; "
            f"leave out the {len(bad_rows)} samples where it was not measured"
        )


def _check_enough(samples: int, dimensions: int, least: int | None) -> None:
    least = max(10, 3 * (dimensions + 1)) if least is None else least
    if samples < least:
        raise NotTrainable(
            f"{samples} samples are too few for {dimensions} sensor{'s' if dimensions > 1 else ''}; "
            f"at least {least} are needed"
        )


def _check_moving(inputs: np.ndarray, names: list[str]) -> None:
    still = [column for column in range(len(names)) if _is_still(inputs[:, column])]
    if not still:
        return
    each = ", ".join(f"sensor {names[column]} reads {inputs[0, column] + 0.0:g}" for column in still)
    alive = [name for column, name in enumerate(names) if column not in still]
    others = ""
    if alive:
        named = ", ".join(alive) if len(alive) <= MOST_NAMED else f"{len(alive)} of them"
        others = f"; name the others ({named}) in a layout file"
    raise NotTrainable(
        f"{each} in all {len(inputs)} samples; move the joint while recording, or leave the "
        f"sensor{'s' if len(still) > 1 else ''} out{others}"
    )


def _is_still(column: np.ndarray) -> bool:
    return float(np.ptp(column)) <= _RELATIVE_STILLNESS * float(np.abs(column).max())


@dataclass(frozen=True)
class Standardised:
    """Samples in working units: inputs = input_shift + input_scale * x, target = likewise with y."""

    x: np.ndarray
    """Shape (N, D)."""
    y: np.ndarray
    """Shape (N,)."""
    input_shift: np.ndarray
    input_scale: np.ndarray
    target_shift: float
    """Degrees."""
    target_scale: float
    """Degrees; variances in working units times its square are degrees squared."""


def standardise(inputs: np.ndarray, target: np.ndarray) -> Standardised:
    """Shift and scale checked samples (``check_samples``): inputs (N, D), target (N,) in degrees."""
    input_shift, input_scale = inputs.mean(axis=0), inputs.std(axis=0)
    target_shift, target_scale = float(target.mean()), float(target.std())
    return Standardised(
        x=(inputs - input_shift) / input_scale,
        y=(target - target_shift) / target_scale,
        input_shift=input_shift,
        input_scale=input_scale,
        target_shift=target_shift,
        target_scale=target_scale,
    )


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
