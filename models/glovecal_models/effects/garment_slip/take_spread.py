"""How the mean error of takes differs inside wearings: what a slip leaves that is slower than a take.

A healthy glove wanders too, but comes back within half a minute, so that the mean of a take hardly shows it.
What changed from take to take anyway (the wearing, the battery, warmth, moisture) may explain its part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from glovecal_models.takes.take import Take

HEALTHY_DEG, HEALTHY_LASTS_S = 0.4, 25.0
"""Every glove wanders by so much and forgets it within this time (first-order)."""
SPREAD_P_VALUE = 0.002
"""That a healthy glove's takes differ so much, for one joint of several."""
MEAN_S = 10.0
SHORTEST_TAKE_S = 2 * MEAN_S
FEWEST_FREE = 3
"""Takes that are left when wearings and context columns have taken theirs."""
EXPLAINING = ("power_on_s", "supply_v", "temperature_c", "humidity_pct")
LATE, LATE_SHARE = "humidity_pct", 0.5
"""Sensors follow this one late: its slope may explain too, where it leaves no more than this share."""
COMMON_JOINTS, COMMON_SHARE = 3, 0.8
"""Sensors slip each by itself; what moves so many together has a cause outside them."""


@dataclass(frozen=True)
class TakeSpread:
    """How the mean errors of the takes of a wearing differ, for one rotation."""

    size_deg: float
    """Standard deviation about the wearing's mean, without what context columns explain."""
    least_deg: float
    """Its lower bound, one-sided, at ``SPREAD_P_VALUE``."""
    healthy_deg: float
    """The same of a healthy glove with takes of this length."""
    over_wander: float
    """Variance over what wandering that comes back, as large as seen inside takes, would give."""
    takes: int

    @property
    def is_slip(self) -> bool:
        return self.least_deg > self.healthy_deg and self.over_wander > 1.0


def spread_of_takes(takes: Sequence[Take], errors: Sequence[np.ndarray]) -> TakeSpread | None:
    """Of errors (N,) for each take, degrees; None when there are too few takes, or too short ones, to say."""
    means = [_long_means(take.time_s, error) for take, error in zip(takes, errors, strict=True)]
    used = [number for number, each in enumerate(means) if len(each) * MEAN_S >= SHORTEST_TAKE_S]
    if len(used) <= FEWEST_FREE:
        return None
    means, takes = [means[number] for number in used], [takes[number] for number in used]
    target = np.array([each.mean() for each in means])
    explained = _explained_by(takes, target)
    free = len(takes) - explained.shape[1]
    if free < FEWEST_FREE:
        return None
    left = target - explained @ (explained.T @ target)
    variance = float(left @ left) / free
    least = float(np.sqrt(variance * free / float(chdtri(free, SPREAD_P_VALUE))))
    inside = float(np.mean([each.var(ddof=1) for each in means]))
    length = float(np.median([len(each) for each in means])) * MEAN_S
    healthy = _wander_of_mean(length)
    wandering = inside / _wander_inside(length) * healthy
    return TakeSpread(
        float(np.sqrt(variance)), least, HEALTHY_DEG * float(np.sqrt(healthy)),
        variance / max(wandering, 1e-12), len(takes),
    )  # fmt: skip


def is_common(takes: Sequence[Take], errors: Sequence[Sequence[np.ndarray]]) -> bool:
    """Whether the takes of several joints differ together: ``errors`` (N,) for each joint and take."""
    if len(errors) < COMMON_JOINTS:
        return False
    known = [number for number in range(len(takes)) if all(np.isfinite(e[number]).any() for e in errors)]
    if len(known) <= FEWEST_FREE:
        return False
    means = np.array([[np.nanmean(joint[number]) for joint in errors] for number in known])
    wearing = _basis(_wearings([takes[number] for number in known]))
    left = means - wearing @ (wearing.T @ means)
    left /= np.maximum(np.linalg.norm(left, axis=0), 1e-12)
    together = np.linalg.svd(left, compute_uv=False) ** 2
    return bool(together[0] > COMMON_SHARE * together.sum())


def _long_means(time_s: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Means over each complete 10 s of which at least half was measured."""
    piece = ((time_s - time_s[0]) / MEAN_S).astype(int)
    known = np.isfinite(error)
    every, count = np.bincount(piece), np.bincount(piece, known)
    total = np.bincount(piece, np.where(known, error, 0.0))
    # The last piece is complete when it has about as many frames as the others.
    good = (count >= 0.5 * every) & (every >= 0.9 * every.max())
    return total[good] / count[good]


def _explained_by(takes: Sequence[Take], target: np.ndarray) -> np.ndarray:
    """Orthonormal (T, K): the wearings, and the context columns that change inside wearings."""
    columns = [*_wearings(takes), *(_level(takes, name) for name in EXPLAINING)]
    # Chance seldom gives a slope so much beside its own column, and each column costs a take.
    late = _basis([*_wearings(takes), _level(takes, LATE), _slope(takes, LATE)])
    plain = _basis([*_wearings(takes), _level(takes, LATE)])
    left, left_late = (float(np.sum((target - part @ (part.T @ target)) ** 2)) for part in (plain, late))
    return _basis([*columns, _slope(takes, LATE)] if left_late < LATE_SHARE * left else columns)


def _wearings(takes: Sequence[Take]) -> list[np.ndarray]:
    names = np.array([take.wearing for take in takes])
    return [(names == name).astype(float) for name in dict.fromkeys(names.tolist())]


def _level(takes: Sequence[Take], name: str) -> np.ndarray:
    """(T,) mean of a context column in each take; zero when a take does not know it."""
    known = [take.context.get(name, np.full(1, np.nan)) for take in takes]
    if not all(np.isfinite(values).any() for values in known):
        return np.zeros(len(takes))
    means = np.array([values[np.isfinite(values)].mean() for values in known])
    return means - means.mean()


def _slope(takes: Sequence[Take], name: str) -> np.ndarray:
    """(T,) per second, of a line through a context column in each take; zero when a take does not know it."""
    found = np.zeros(len(takes))
    for number, take in enumerate(takes):
        values = take.context.get(name, np.full(len(take.time_s), np.nan))
        known = np.isfinite(values)
        if known.sum() < 2:
            return np.zeros(len(takes))
        time = take.time_s[known] - take.time_s[known].mean()
        found[number] = float(time @ values[known]) / float(time @ time)
    return found - found.mean()


def _basis(columns: Sequence[np.ndarray]) -> np.ndarray:
    """Orthonormal (T, K) of the columns (T,), each made as long as the others."""
    sizes = [float(np.linalg.norm(column)) for column in columns]
    scaled = [column / size for column, size in zip(columns, sizes, strict=True) if size > 1e-9]
    vectors, weights, _ = np.linalg.svd(np.column_stack(scaled), full_matrices=False)
    return vectors[:, weights > 1e-6 * weights[0]]


def _wander_of_mean(length_s: float) -> float:
    """Variance of a mean over so long, of a wander of variance one that lasts ``HEALTHY_LASTS_S``."""
    ratio = HEALTHY_LASTS_S / length_s
    return 2.0 * ratio * (1.0 - ratio * (1.0 - float(np.exp(-1.0 / ratio))))


def _wander_inside(length_s: float) -> float:
    """Variance that the same wander's 10 s means have about the mean of their take."""
    pieces = length_s / MEAN_S
    return pieces / (pieces - 1.0) * (_wander_of_mean(MEAN_S) - _wander_of_mean(length_s))
