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
    weights, centre = _fitted(np.concatenate(columns), target)
    return [centre + part @ weights for part in columns]


def _curves(scaled: np.ndarray, degree: int) -> np.ndarray:
    """Legendre polynomials without the constant, (N, S * degree); ``scaled``: (N, S), -1 to 1."""
    powers = np.polynomial.legendre.legvander(scaled, degree)[..., 1:]
    return powers.reshape(len(scaled), scaled.shape[1] * degree)


def _fitted(design: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P, R) and (R,): least squares, with a ridge that only holds what nothing else does; all 0 for a
    rotation that was never measured. What was measured in the same rows is fitted together."""
    weights, centre = np.zeros((design.shape[1], target.shape[1])), np.zeros(target.shape[1])
    alike: dict[bytes, list[int]] = {}
    for column, known in enumerate(np.isfinite(target).T):
        if known.any():
            alike.setdefault(known.tobytes(), []).append(column)
    for together in alike.values():
        known = np.isfinite(target[:, together[0]])
        some, angles = (design, target) if known.all() else (design[known], target[known])
        centre[together] = angles[:, together].mean(axis=0)
        gram = some.T @ some + RIDGE * len(some) * np.eye(some.shape[1])
        weights[:, together] = np.linalg.solve(gram, some.T @ (angles[:, together] - centre[together]))
    return weights, centre
