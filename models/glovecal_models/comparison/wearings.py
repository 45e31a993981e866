"""Does the error change from one wearing to the next by more than from take to take?"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import Residuals

MOST_PARTITIONS = 2000


@dataclass(frozen=True)
class WearingErrors:
    """Mean error of one rotation in each wearing."""

    rotation: str
    wearings: tuple[str, ...]
    mean_deg: tuple[float, ...]
    takes: tuple[int, ...]
    spread_deg: float
    """Root mean square of the wearings' means about their mean."""
    p_value: float | None
    """Share of permutations of the takes over the wearings that spread as widely; None: too few takes."""
    limits: ComparisonLimits = COMPARISON_LIMITS

    @property
    def is_significant(self) -> bool:
        """Whether the error changes with the wearing by more than from take to take."""
        return self.p_value is not None and self.p_value <= self.limits.wearing_p_value


def wearing_errors(
    found: Residuals,
    rotation: str,
    generator: np.random.Generator,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> WearingErrors | None:
    """None with fewer than two wearings in which the rotation was measured."""
    column = found.column(rotation)
    means, labels = [], []
    for item in found.takes:
        error = item.error[:, column]
        if np.isfinite(error).any():
            means.append(float(np.nanmean(error)))
            labels.append(item.take.wearing)
    names = tuple(dict.fromkeys(labels))
    if len(names) < 2:
        return None
    values, owners = np.array(means), np.array([names.index(label) for label in labels])
    each = tuple(float(values[owners == i].mean()) for i in range(len(names)))
    counts = tuple(int((owners == i).sum()) for i in range(len(names)))
    p_value = _p_value(values, owners, counts, generator, limits.wearing_fewest_deals)
    spread = float(np.std(each))
    return WearingErrors(rotation, names, each, counts, spread, p_value, limits)


def _p_value(
    values: np.ndarray,
    owners: np.ndarray,
    counts: tuple[int, ...],
    generator: np.random.Generator,
    fewest: int,
) -> float | None:
    """Over distinct permutations without the true one, which random draws would repeat."""
    if _partitions(counts) < fewest or min(counts) < 2:
        return None
    true = _spread(values, owners)
    others = [_spread(values, permuted) for permuted in _permutations(owners, counts, generator)]
    return (1 + sum(other >= true - 1e-12 for other in others)) / (1 + len(others))


def _spread(values: np.ndarray, owners: np.ndarray) -> float:
    """Between-wearing sum of squares."""
    sums, counts = np.bincount(owners, values - values.mean()), np.bincount(owners)
    return float(np.sum(sums**2 / counts))


def _partitions(counts: tuple[int, ...]) -> int:
    """Distinct ways to split the takes into groups of these sizes, groups of equal size not told apart."""
    left, ways = sum(counts), 1
    for count in counts:
        ways *= comb(left, count)
        left -= count
    for size in set(counts):
        same = counts.count(size)
        for number in range(2, same + 1):
            ways //= number
    return ways


def _permutations(
    owners: np.ndarray, counts: tuple[int, ...], generator: np.random.Generator
) -> list[np.ndarray]:
    """All other partitions when they are few, else many random ones, each at most once."""
    found: dict[bytes, np.ndarray] = {}
    if len(counts) == 2 and _partitions(counts) <= MOST_PARTITIONS:
        first = np.array(list(combinations(range(len(owners)), counts[0])))
        drawn = np.ones((len(first), len(owners)), dtype=int)
        np.put_along_axis(drawn, first, 0, axis=1)
    else:
        drawn = np.array([generator.permutation(owners) for _ in range(2 * MOST_PARTITIONS)])
    for permuted, partition in zip(drawn, _partitions_of(drawn), strict=True):
        found[partition.tobytes()] = permuted
    found.pop(_partitions_of(owners[None])[0].tobytes(), None)
    return list(found.values())[:MOST_PARTITIONS]


def permuted_sessions(owners: np.ndarray, most: int, generator: np.random.Generator) -> list[np.ndarray]:
    """Up to ``most`` other ways to deal takes to wearings of the same sizes, each at most once."""
    counts = tuple(np.bincount(owners).tolist())
    permutations = _permutations(owners, counts, generator)
    return [permutations[i] for i in generator.permutation(len(permutations))[:most]]


def _partitions_of(owners: np.ndarray) -> np.ndarray:
    """``partition_of`` each row of (D, T), whose numbers are below T."""
    numbers = np.arange(owners.shape[1])
    is_owner = owners[:, None, :] == numbers[None, :, None]
    first = np.where(is_owner.any(axis=2), is_owner.argmax(axis=2), owners.shape[1])
    rank = np.argsort(np.argsort(first, axis=1, kind="stable"), axis=1)
    return np.take_along_axis(rank, owners, axis=1)


def partition_of(owners: np.ndarray) -> tuple[int, ...]:
    """The same for partitions that differ only in the groups' names."""
    names: dict[int, int] = {}
    return tuple(names.setdefault(int(owner), len(names)) for owner in owners)
