"""Samples as trainers need them: checked, with a sentence a user can act on, then standardised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import NotTrainable

_RELATIVE_STILLNESS = 1e-12
MOST_NAMED = 8
"""Sensors; more are counted."""


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
