"""A plain map from the readings to the angles, the same whatever model is looked at.

A noise floor belongs to the measurements. Taken from a model's residuals it would follow the model: one that
has learned its takes by heart would have a floor of zero. So it is taken from what an additive model leaves:
a cubic of every sensor, and a constant for each wearing (Hastie and Tibshirani 1990).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.takes.take import Take

CUBIC = 3
ROWS_PER_CURVE = 50
"""Neighbouring rows are alike; with fewer a straight line of every sensor has to do."""
RIDGE = 1e-6


def additive_fit(takes: Sequence[Take], reference: Sequence[np.ndarray]) -> list[np.ndarray]:
    """For each take (N, R), degrees; ``reference``: (N, R) at the frames, NaN where not measured.

    Sensors that all takes have and that move are read. A rotation that was never measured is 0.
    """
    shared = [name for name in takes[0].sensors if all(name in take.sensors for take in takes)]
    readings = [take.readings[:, [take.sensors.index(name) for name in shared]] for take in takes]
    every = np.concatenate(readings)
    target = np.concatenate(reference)
    moving = np.ptp(every, axis=0) > 0 if len(every) else np.zeros(len(shared), dtype=bool)
    low, span = every[:, moving].min(axis=0), np.ptp(every[:, moving], axis=0)
    rows = int(np.isfinite(target).sum(axis=0).max(initial=0))
    degree = CUBIC if rows >= ROWS_PER_CURVE * CUBIC * int(moving.sum()) else 1
    wearings = list(dict.fromkeys(take.wearing for take in takes))
    columns = [
        np.column_stack([
            *(np.full(len(take.time_s), float(take.wearing == name)) for name in wearings),
            _curves(2.0 * (part[:, moving] - low) / span - 1.0, degree),
        ])
        for take, part in zip(takes, readings, strict=True)
    ]  # fmt: skip
    found = [_fitted(columns, target[:, column]) for column in range(target.shape[1])]
    return [np.column_stack([each[number] for each in found]) for number in range(len(takes))]


def _curves(scaled: np.ndarray, degree: int) -> np.ndarray:
    """Legendre polynomials without the constant, (N, S * degree); ``scaled``: (N, S), -1 to 1."""
    powers = np.polynomial.legendre.legvander(scaled, degree)[..., 1:]
    return powers.reshape(len(scaled), scaled.shape[1] * degree)


def _fitted(columns: Sequence[np.ndarray], target: np.ndarray) -> list[np.ndarray]:
    """For each take (N,): least squares, with a ridge that only holds what nothing else does."""
    known = np.isfinite(target)
    if not known.any():
        return [np.zeros(len(part)) for part in columns]
    design, centre = np.concatenate(columns)[known], float(target[known].mean())
    gram = design.T @ design + RIDGE * len(design) * np.eye(design.shape[1])
    weights = np.linalg.solve(gram, design.T @ (target[known] - centre))
    return [centre + part @ weights for part in columns]
