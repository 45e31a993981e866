"""Do the errors of several joints rise and fall together? By how many degrees, and could that be chance?

What two joints have in common is the covariance of their second means; chance is the same of errors shifted
in time against each other, each take around its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.slow_error import SecondMeans

SHIFTS = 199


@dataclass(frozen=True)
class SharedError:
    """All joints of a design."""

    size_deg: float
    """What pairs of joints have in common beyond chance, root mean square over pairs."""
    probability: float
    """Share of shifts that have as much in common."""


NOTHING_SHARED = SharedError(0.0, 1.0)


def shared_error(
    joints: Sequence[Sequence[SecondMeans]],
    generator: np.random.Generator,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> SharedError:
    """``joints``: for each joint its takes."""
    long = [take for take in zip(*joints, strict=True) if len(take[0].weight) >= limits.shared_shortest_s]
    takes = [_together(take) for take in long]
    if len(joints) < 2 or not takes:
        return NOTHING_SHARED
    pairs = np.triu_indices(len(joints), 1)
    covariance = np.zeros((1 + SHIFTS, len(pairs[0])))
    for values in takes:
        length = values.shape[1]
        moved = generator.integers(2, length - 1, (SHIFTS, len(joints)))
        moved = np.concatenate([np.zeros((1, len(joints)), dtype=int), moved])
        at = (np.arange(length) - moved[:, :, None]) % length
        shifted = values[np.arange(len(joints))[None, :, None], at]
        covariance += (shifted @ shifted.transpose(0, 2, 1))[:, *pairs]
    covariance /= sum(values.shape[1] for values in takes)
    square = np.mean(covariance**2, axis=1)
    beyond = max(float(square[0] - square[1:].mean()), 0.0)
    return SharedError(beyond**0.25, float(np.mean(square >= square[0] * (1 - 1e-9))))


def _together(take: Sequence[SecondMeans]) -> np.ndarray:
    """(J, S): second means about their mean, those of unfamiliar inputs made small."""
    weight = np.array([item.weight for item in take])
    mean = np.array([item.mean_deg for item in take])
    centre = np.sum(weight * mean, axis=1) / np.maximum(weight.sum(axis=1), 1e-9)
    return np.sqrt(weight) * (mean - centre[:, None])
