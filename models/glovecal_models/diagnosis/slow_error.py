"""How large a held-out error is beside a healthy glove's: the part that lasts for seconds, and how many noise
floors all of it is, both with a lower 95 % bound.

Slow error: means of neighbouring seconds are multiplied. Noise that is forgotten within a second averages to
nothing, whatever its size; an error that lasts gives its mean square. How far the products differ from one
stretch of the recording to the next says how much can be known: few stretches, an error that is large only
once, or one that hardly exceeds the noise give a low bound, down to 0.

Held-out errors averaged over whole seconds: noise from frame to frame cancels, what lasts stays.

An error that is short, rare and on one joint alone has no slow part and nothing in common with others: that
it is far above what the measurements repeat themselves to is all that shows it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import chdtri, stdtrit

from glovecal_models.calibration.held_out import ALIKE_ROWS, BaseProducts
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits


@dataclass(frozen=True)
class FloorRatio:
    """The held-out error of one joint, readings and reference identically smoothed, beside its floor."""

    rmse_deg: float
    lower_bound_deg: float
    """Lower end of the one-sided 95 % interval, from stretches of 10 s."""
    floor: NoiseFloor
    """Of errors that are not smoothed: a smoothed one may lie below it."""
    stretches: int
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    @property
    def is_judgeable(self) -> bool:
        """Whether floor and error are known well enough."""
        known = self.floor.is_reliable and not self.floor.is_lower_bound and self.floor.floor_deg > 0
        return known and self.stretches >= self.limits.slow_fewest_stretches

    @property
    def times(self) -> float:
        return self.rmse_deg / max(self.floor.floor_deg, 1e-9)

    @property
    def lower_times(self) -> float:
        """The lower bound of the error over the upper end of the floor's interval."""
        return self.lower_bound_deg / max(self.floor.high_deg, 1e-9)

    @property
    def is_within_floor(self) -> bool:
        """Whether the error is noise: inside the interval of a floor that is known well enough."""
        return self.is_judgeable and self.rmse_deg <= self.floor.high_deg

    @property
    def is_healthy(self) -> bool:
        """Whether the error is so few floors as a healthy glove's; False where that cannot be judged."""
        return self.is_judgeable and self.times <= self.limits.healthy_floors

    @property
    def exceeds(self) -> float:
        """Times the most that a healthy glove has; 0 where that cannot be judged."""
        return self.lower_times / self.limits.healthy_floors if self.is_judgeable else 0.0


def floor_ratios(design: ForwardDesign, floors: Mapping[str, NoiseFloor]) -> dict[str, FloorRatio]:
    """Of each joint of ``design`` whose floor is known."""
    found = {}
    for joint, name in enumerate(design.rotations):
        squares, counts = _stretches(design, joint)
        if name in floors and counts.sum():
            rmse = float(np.sqrt(squares.sum() / counts.sum()))
            lower = _lower_deg(squares, counts, design.limits)
            found[name] = FloorRatio(rmse, lower, floors[name], len(counts), design.limits)
    return found


def _stretches(design: ForwardDesign, joint: int) -> tuple[np.ndarray, np.ndarray]:
    """Sum of squared errors and number of rows in each stretch, (K,) both."""
    squares, counts = [], []
    for (take, rows), residual in zip(design.units(joint), design.products[joint].residual, strict=True):
        if not len(rows):
            continue
        time = design.signals[take].time_s[rows]
        number = ((time - time[0]) / STRETCH_S).astype(int)
        squares.append(np.bincount(number, residual**2))
        counts.append(np.bincount(number))
    if not counts:
        return np.zeros(0), np.zeros(0)
    square, count = np.concatenate(squares), np.concatenate(counts)
    return square[count > 0], count[count > 0]


def _lower_deg(squares: np.ndarray, counts: np.ndarray, limits: DiagnosisLimits) -> float:
    """Of a ratio of sums over stretches (Cochran 1977), by Student's t; 0 from one stretch."""
    number = len(counts)
    if number < 2:
        return 0.0
    mean = squares.sum() / counts.sum()
    differing = squares - mean * counts
    error = np.sqrt(number / (number - 1) * np.sum(differing**2)) / counts.sum()
    return float(np.sqrt(max(mean - stdtrit(number - 1, limits.slow_confidence) * error, 0.0)))


EVERY = 5
"""Neighbouring rows are about equally unfamiliar."""
LEAST_FILLED = 0.5
"""Share of a second's rows that must have been measured."""


@dataclass(frozen=True)
class SecondMeans:
    """One joint in one take of S seconds."""

    mean_deg: np.ndarray
    """(S,), sensor minus what the base says; 0 where too little was measured."""
    weight: np.ndarray
    """(S,), 1 where the base knows such inputs well, towards 0 where it guesses; 0 where not measured."""


def second_means(design: ForwardDesign, joint: int) -> list[SecondMeans]:
    """For each take of the design."""
    products = design.products[joint]
    found = []
    for number, take in enumerate(design.signals):
        mine = [unit for unit, owner in enumerate(design.unit_take) if owner == number]
        rows = [design.used[joint][unit] for unit in mine]
        start = take.time_s[0] if len(take.time_s) else 0.0
        seconds = int(take.time_s[-1] - start) if len(take.time_s) else 0
        at = np.concatenate([take.time_s[index] - start for index in rows]).astype(int)
        residual = np.concatenate([products.residual[unit] for unit in mine])
        unfamiliar = np.concatenate([_unfamiliar(products, unit) for unit in mine])
        inside = at < seconds
        count = np.bincount(at[inside], minlength=seconds)
        whole = np.median(count[count > 0]) if count.any() else 1.0
        filled = count >= LEAST_FILLED * whole
        mean, leverage = (
            np.bincount(at[inside], values[inside], minlength=seconds) / np.maximum(count, 1)
            for values in (residual, unfamiliar)
        )
        weight = np.where(filled & (count > 0), 1 / (1 + leverage), 0.0)
        found.append(SecondMeans(np.where(weight > 0, mean, 0.0), weight))
    return found


def without_drift(take: SecondMeans) -> SecondMeans:
    """Without the take's mean and straight line: what is left wanders within the take."""
    known = take.weight > 0
    if known.sum() < 3:
        return take
    at, weight = np.flatnonzero(known), take.weight[known]
    line = np.polyfit(at, take.mean_deg[known], 1, w=np.sqrt(weight))
    rest = np.zeros_like(take.mean_deg)
    rest[known] = take.mean_deg[known] - np.polyval(line, at)
    return SecondMeans(rest, take.weight)


def _unfamiliar(products: BaseProducts, unit: int) -> np.ndarray:
    """(N,): variance of the base's own error on a unit left out, over the variance of what it was fitted to.

    x' G^-1 x of linear regression, G of all other units, with so many rows counted as one as are alike.
    """
    base = products.units[unit].base
    if not len(base):
        return np.empty(0)
    lower = cholesky(products.gram.sum(axis=0) - products.gram[unit] + products.ridge, lower=True)
    solved = solve_triangular(lower, base[::EVERY].T, lower=True)
    return ALIKE_ROWS * np.repeat((solved**2).sum(axis=0), EVERY)[: len(base)]


STRETCH_S = 10


@dataclass(frozen=True)
class SlowError:
    """One joint, degrees root mean square; over the stretches in which it was measured."""

    size_deg: float
    lower_bound_deg: float
    """Lower end of the one-sided 95 % interval, never above ``size_deg``; 0 where so little data bounds it by
    nothing, since a mean square cannot be negative anyway."""
    noise_deg: float
    """From row to row."""
    stretches: int


def slow_error(
    takes: Sequence[SecondMeans], residual: Sequence[np.ndarray], limits: DiagnosisLimits = DIAGNOSIS_LIMITS
) -> SlowError:
    """``residual``: the same joint's error row by row, for its noise."""
    products, weights, squares = [], [], 0.0
    for take in takes:
        both = take.weight[1:] * take.weight[:-1] > 0
        weight = np.sqrt(take.weight[1:] * take.weight[:-1])[both]
        product = (take.mean_deg[1:] * take.mean_deg[:-1])[both] * weight
        if len(weight) < limits.slow_shortest_s - 1:
            continue
        square = 0.5 * (take.mean_deg[1:] ** 2 + take.mean_deg[:-1] ** 2)[both]
        squares += float(weight @ square)
        for part in np.array_split(np.arange(len(weight)), max(1, round(len(weight) / STRETCH_S))):
            products.append(float(product[part].sum()))
            weights.append(float(weight[part].sum()))
    noise = _noise(residual)
    if not products:
        return SlowError(0.0, 0.0, noise, 0)
    total, count = sum(weights), len(products)
    square = max(sum(products) / total, 0.0)
    differing = np.array(products) - square * np.array(weights)
    variance = count / max(count - 1, 1) * float(np.sum(differing**2)) / total**2
    forgotten = max(squares / total - square, 0.0)
    lower = _lower(square, variance, forgotten**2 / total, count, limits)
    return SlowError(_root(square), _root(lower), noise, count)


def _lower(square: float, variance: float, of_noise: float, count: int, limits: DiagnosisLimits) -> float:
    """Of a mean square from ``count`` stretches, whose estimate varies by ``variance``.

    ``of_noise`` of that is products of noise, as much below zero as above: Student's t. The rest varies with
    the square itself: a scaled chi squared (Satterthwaite 1946). The two distances from the estimate are
    added in squares, as for differences of variances (Graybill and Wang 1980). Chi squared alone claims more
    than there is in up to half of the recordings with nothing but noise, and with a small fraction of a
    degree of freedom more than the estimate.
    """
    if square <= 0 or count < 2:
        return 0.0
    confidence = limits.slow_confidence
    of_noise = min(of_noise, variance)
    lasting = variance - of_noise
    most = count - 1.0
    freedom = min(2 * square**2 / lasting, most) if lasting > 2 * square**2 / most else most
    if freedom < limits.slow_least_freedom:
        return 0.0
    of_lasting = square * (1.0 - min(freedom / float(chdtri(freedom, 1.0 - confidence)), 1.0))
    distance = float(np.hypot(stdtrit(count - 1, confidence) * np.sqrt(of_noise), of_lasting))
    return max(square - distance, 0.0)


def _root(square: float) -> float:
    return float(np.sqrt(max(square, 0.0)))


def _noise(residual: Sequence[np.ndarray]) -> float:
    """Standard deviation of what changes from row to row, by the median of squared differences."""
    steps = np.concatenate([np.diff(part) for part in residual]) if residual else np.empty(0)
    return float(np.sqrt(np.median(steps**2) / 0.4549)) if len(steps) else 0.0


SHIFTS = 199
"""Of joints against each other, each take around its end: the null distribution of their covariance."""


@dataclass(frozen=True)
class SharedError:
    """What the errors of several joints have in common."""

    size_deg: float
    """Of the covariance of two joints beyond its mean over shifts, root mean square over pairs."""
    p_value: float
    """Share of shifts with as much covariance."""


NOTHING_SHARED = SharedError(0.0, 1.0)


def shared_error(
    joints: Sequence[Sequence[SecondMeans]],
    generator: np.random.Generator,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> SharedError:
    """From the covariance of second means; ``joints``: for each joint its takes."""
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
