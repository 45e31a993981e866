"""Does an error depend on a column, or is it noise? A test that survives errors that are alike in time.

The error is averaged in bins of the column. How much the bin means spread is compared with what the same
error series gives when it is shifted in time against the column, each take by its own random amount and
around its end: that keeps how alike neighbouring frames are, and breaks only the tie to the column. All
shifts of a take come from one Fourier transform.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.comparison.where.answer import Dependence
from glovecal_models.effects.base.power_on import POWER_ON

UNITS = {"v": "V", "c": "°C", "pct": "%", "s": "s", "n": "N", "g": "g"}
"""What the end of a context column's name says of its unit: ``supply_v`` is in volts."""
WINDOW_S = 0.1
"""Angle and speed are taken over about this long: shorter, they show the noise of the reference."""
BINS = 8
SHIFTS = 999
SHORTEST_SHIFT = 0.05
"""Share of a take below which a shift leaves nearly the same pairing."""
FEWEST_STEPS_TO_SHIFT = 16
"""A shorter take has too few different shifts; it is left out of the test."""
STEPS_AT_MOST = 4000


@dataclass(frozen=True)
class Covariate:
    """One column over all takes of a comparison, for one rotation."""

    name: str
    """Such as "angle", "speed", "sensor I_PIP", "time since power-on", "context temperature_c"."""
    unit: str
    phrase: str
    """How a sentence names it: "the angle itself"."""
    values: tuple[np.ndarray, ...]
    """For each take (N,), NaN where unknown."""


def covariates(found: Residuals, rotation: str) -> Iterator[Covariate]:
    """Everything the error of ``rotation`` is held against, in the order a report shows it."""
    column = found.column(rotation)
    speeds = tuple(_speed(item, column) for item in found.takes)
    angle = tuple(_smooth(item, column) for item in found.takes)
    yield Covariate("angle", "deg", "the angle itself", angle)
    yield Covariate("speed", "deg/s", "how fast the joint moves", tuple(np.abs(v) for v in speeds))
    yield Covariate("direction", "deg/s", "which way the joint moves", speeds)
    in_take = tuple(item.take.time_s - item.take.start_s for item in found.takes)
    yield Covariate("time in take", "s", "how long the take has lasted", in_take)
    for sensor in dict.fromkeys(name for item in found.takes for name in item.take.sensors):
        readings = tuple(_reading(item, sensor) for item in found.takes)
        yield Covariate(f"sensor {sensor}", "counts", f"the reading of sensor {sensor}", readings)
    for name in dict.fromkeys(name for item in found.takes for name in item.take.context):
        values = tuple(_context(item, name) for item in found.takes)
        yield _of_context(name, values)


def joint_columns(found: Residuals, rotation: str) -> Iterator[Covariate]:
    """The measured angle of every other rotation: asked for one by one, as a hand's joints move together and
    most would seem to matter."""
    for name in found.measured_rotations:
        if name != rotation:
            angle = tuple(_smooth(item, found.column(name)) for item in found.takes)
            yield Covariate(f"joint {name}", "deg", f"the angle of {name}", angle)


def context_unit(name: str) -> str:
    """The unit of a context column by the end of its name; "" when that says nothing."""
    before, _, ending = name.rpartition("_")
    return UNITS.get(ending.lower(), "") if before else ""


def _of_context(name: str, values: tuple[np.ndarray, ...]) -> Covariate:
    unit = context_unit(name)
    if name == POWER_ON:
        return Covariate("time since power-on", unit, "how long the glove has been on", values)
    return Covariate(f"context {name}", unit, f"the context column {name}", values)


def _half_window(time: np.ndarray) -> int:
    return max(1, round(0.5 * WINDOW_S / float(np.median(np.diff(time))))) if len(time) > 2 else 1


def _smooth(item: TakeResiduals, column: int) -> np.ndarray:
    """The measured angle, (N,), as a moving mean.

    The error holds the reference's noise; held against that same noise it would seem to depend on the angle.
    """
    angle, half = item.measured[:, column], _half_window(item.take.time_s)
    if len(angle) <= 2 * half:
        return angle
    result = np.full(len(angle), np.nan)
    result[half:-half] = np.lib.stride_tricks.sliding_window_view(angle, 2 * half + 1).mean(axis=1)
    return result


def _speed(item: TakeResiduals, column: int) -> np.ndarray:
    """Speed of the measured angle, (N,), degrees per second; NaN at the ends and beside gaps."""
    angle, time = item.measured[:, column], item.take.time_s
    result = np.full(len(angle), np.nan)
    half = _half_window(time)
    if len(time) > 2 * half:
        rise = angle[2 * half :] - angle[: -2 * half]
        result[half:-half] = rise / (time[2 * half :] - time[: -2 * half])
    return result


def _reading(item: TakeResiduals, sensor: str) -> np.ndarray:
    if sensor not in item.take.sensors:
        return np.full(len(item.take.time_s), np.nan)
    return item.take.readings[:, item.take.sensors.index(sensor)]


def _context(item: TakeResiduals, name: str) -> np.ndarray:
    unknown = np.full(len(item.take.time_s), np.nan)
    return np.asarray(item.take.context.get(name, unknown), dtype=float)


def dependence(
    errors: tuple[np.ndarray, ...],
    covariate: Covariate,
    generator: np.random.Generator,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> Dependence | None:
    """``errors``: for each take (N,), degrees. None when the covariate takes fewer than two values."""
    pairs = _known_pairs(errors, covariate)
    edges = _edges(pairs)
    if len(edges) < 2:
        return None
    error, value = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    bins = len(edges) - 1
    where = _bin(value, edges)
    count = np.bincount(where, minlength=bins)
    mean = np.bincount(where, error, minlength=bins) / np.maximum(count, 1)
    spread = float(np.sqrt(np.average((mean - error.mean()) ** 2, weights=count)))
    series = [_thinned(e - error.mean(), _bin(v, edges)) for e, v in pairs]
    chance, p_value = _against_shifts(series, bins, generator)
    reach = [None if np.isnan(value) else value for value in chance.tolist()]
    is_significant = p_value <= limits.structure_p_value
    matters = bool(spread**2 >= limits.structure_share * np.nanmean(np.concatenate(errors) ** 2))
    return Dependence(
        covariate.name, covariate.unit, covariate.phrase, edges.tolist(), mean.tolist(), count.tolist(),
        reach, spread, p_value, is_significant, is_significant and matters,
    )  # fmt: skip


@dataclass(frozen=True)
class ShiftedErrors:
    """What a covariate explains of errors as they are, and shifted in time."""

    series: list[tuple[int, np.ndarray, np.ndarray]]
    """Number, errors (N,) without the mean of all, and bins (N,) of each take that is long enough."""
    bins: int

    @classmethod
    def of(
        cls, errors: tuple[np.ndarray, ...], covariate: Covariate, steps_at_most: int
    ) -> ShiftedErrors | None:
        """Takes longer than ``steps_at_most`` are averaged to that. None when the covariate takes fewer than
        two values or no take is long enough."""
        pairs = _known_pairs(errors, covariate)
        edges = _edges(pairs)
        if len(edges) < 2:
            return None
        centre = float(np.concatenate([e for e, _ in pairs]).mean())
        series = [_thinned(e - centre, _bin(v, edges), steps_at_most) for e, v in pairs]
        long = [
            (number, *item) for number, item in enumerate(series) if len(item[0]) >= FEWEST_STEPS_TO_SHIFT
        ]
        return cls(long, len(edges) - 1) if long else None

    @property
    def explained_deg(self) -> float:
        """As they are."""
        sums, counts = (
            sum(np.bincount(where, weight, self.bins) for where, weight in each)
            for each in (
                [(where, error) for _, error, where in self.series],
                [(where, None) for _, _, where in self.series],
            )
        )
        return float(np.sqrt(np.sum(sums**2 / np.maximum(counts, 1)) / np.sum(counts)))

    def explained_when_shifted(self, shares: np.ndarray) -> np.ndarray:
        """(1 + S,), degrees: as they are, then shifted. ``shares`` (S, takes), 0 to 1, say how far each take
        is shifted, so that several columns can be held against the same shifts."""
        shifts = [
            _least_shift(len(error)) + (shares[:, number] * _shift_span(len(error))).astype(int)
            for number, error, _ in self.series
        ]
        series = [(error, where) for _, error, where in self.series]
        sums, counts = _sums_when_shifted(series, self.bins, shifts)
        return np.sqrt(np.sum(sums**2 / np.maximum(counts, 1), axis=1) / counts.sum())


def _known_pairs(errors: tuple[np.ndarray, ...], covariate: Covariate) -> list[tuple[np.ndarray, np.ndarray]]:
    """Error and covariate of each take where both are known; takes without such frames are left out."""
    usable = [np.isfinite(e) & np.isfinite(v) for e, v in zip(errors, covariate.values, strict=True)]
    return [(e[u], v[u]) for e, v, u in zip(errors, covariate.values, usable, strict=True) if u.any()]


def _edges(pairs: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Edges of bins that hold about equally many frames; fewer than two when the covariate never changes."""
    if not pairs:
        return np.empty(0)
    value = np.concatenate([v for _, v in pairs])
    return np.unique(np.quantile(value, np.linspace(0, 1, BINS + 1)))


def _bin(value: np.ndarray, edges: np.ndarray) -> np.ndarray:
    return np.clip(np.searchsorted(edges, value, side="right") - 1, 0, len(edges) - 2)


def _thinned(
    error: np.ndarray, where: np.ndarray, steps_at_most: int = STEPS_AT_MOST
) -> tuple[np.ndarray, np.ndarray]:
    """Means over neighbouring frames of a long take, with the bin of the middle one."""
    step = -(-len(error) // steps_at_most)
    length = len(error) // step * step
    return error[:length].reshape(-1, step).mean(axis=1), where[step // 2 : length : step]


def _against_shifts(
    series: list[tuple[np.ndarray, np.ndarray]], bins: int, generator: np.random.Generator
) -> tuple[np.ndarray, float]:
    """What the shifts make of each bin's mean, and the share of them that spread the means as widely."""
    tested = [item for item in series if len(item[0]) >= FEWEST_STEPS_TO_SHIFT]
    if not tested:
        return np.full(bins, np.nan), 1.0
    shifts = [_random_shifts(len(error), generator) for error, _ in tested]
    sums, counts = _sums_when_shifted(tested, bins, shifts)
    spread = np.sum(sums**2 / np.maximum(counts, 1), axis=1)
    chance = np.percentile(np.abs(sums[1:] / np.maximum(counts, 1)), 95, axis=0)
    return chance, float((1 + np.count_nonzero(spread[1:] >= spread[0])) / (SHIFTS + 1))


def _sums_when_shifted(
    series: list[tuple[np.ndarray, np.ndarray]], bins: int, shifts: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """(1 + S, bins) sums of the errors in each bin, unshifted first, and how many steps a bin has (bins,)."""
    sums, counts = np.zeros((1 + len(shifts[0]), bins)), np.zeros(bins)
    for (error, where), of_take in zip(series, shifts, strict=True):
        sums += _shifted_sums(error, where, bins)[:, np.append(0, of_take)].T
        counts += np.bincount(where, minlength=bins)
    return sums, counts


def _random_shifts(length: int, generator: np.random.Generator) -> np.ndarray:
    least = _least_shift(length)
    return generator.integers(least, least + _shift_span(length), SHIFTS)


def _least_shift(length: int) -> int:
    return max(1, round(SHORTEST_SHIFT * length))


def _shift_span(length: int) -> int:
    """How many shifts there are, the least one and its mirror image included."""
    return length - 2 * _least_shift(length) + 1


def _shifted_sums(error: np.ndarray, where: np.ndarray, bins: int) -> np.ndarray:
    """(bins, N): sum of the error in each bin after shifting it by 0 to N - 1 steps."""
    indicator = (where == np.arange(bins)[:, None]).astype(float)
    product = np.fft.rfft(error) * np.conj(np.fft.rfft(indicator, axis=1))
    return np.fft.irfft(product, n=len(error), axis=1)
