"""How small an error can get on these measurements: what repeats by itself no better than this.

Six estimates; the best that the takes allow counts, the others stay beside it. In this order, from the one
that holds the least a better model could still take away:

* still hand: while the whole hand is held the error should not move; its spread around each hold's line is
  noise of sensor and reference.
* still joint: only the joint itself is held; a neighbour that pulls at its sensor is in it too.
* repeated poses: how well the error of a pose comes back within a wearing. Hysteresis and drift are in it,
  and how exactly the pose was taken; recordings of one frame a pose have nothing better.
* spectrum: the plateau of the error's spectrum at high frequencies, a lower bound: noise with a memory is
  not in it.
* frame to frame: second differences, a lower bound likewise, from the shortest recordings.
* near readings: only for a table of single poses without their names, which has none of the others: how far
  the reference differs between frames with nearly the same readings, the half of all frames with the nearest
  neighbours. Rough, and from above: what the readings still differ by is included.

Where the reference states standard deviations, as a camera does, a floor is never below them: "stated".

The floor belongs to the takes and not to a model: errors are those of a plain additive map of all sensors
(``additive_fit``), so that every verb tells the same floor for the same takes. Only the jitter beside it is
of the model at hand. ``floor_doubts`` says when a floor is not reliable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from glovecal_models.comparison.error_spectrum import ErrorSpectrum, error_spectrum
from glovecal_models.comparison.floor_estimate import How, NoiseFloor, pooled, stated_floor
from glovecal_models.comparison.holds import (
    Hold,
    clock_doubts,
    from_repeated_poses,
    hold_doubts,
    holds,
    slow_sampling,
)
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.takes.take import Take

CHI_SQUARED_MEDIAN = 0.4549
"""With one degree of freedom."""


@dataclass(frozen=True)
class _PlainResiduals(TakeResiduals):
    """What the plain map leaves; ``predicted`` stays the model's, for its jitter."""

    left: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))

    @cached_property
    def error(self) -> np.ndarray:
        return self.left


def plain_residuals(takes: Sequence[Take], rotations: Sequence[str]) -> Residuals:
    """Of the plain map alone, for takes without a model."""
    measured = [take.reference_at_frames(rotations) for take in takes]
    mapped = additive_fit(takes, measured)
    parts = zip(takes, mapped, measured, strict=True)
    return Residuals(
        tuple(rotations),
        tuple(TakeResiduals(take, angles, np.zeros_like(angles), known) for take, angles, known in parts),
    )


def _of_plain_map(found: Residuals) -> Residuals:
    """The same takes and predictions beside the errors of the plain map."""
    mapped = additive_fit([item.take for item in found.takes], [item.measured for item in found.takes])
    return Residuals(
        found.rotations,
        tuple(
            _PlainResiduals(item.take, item.predicted, item.sd, item.measured, left=angles - item.measured)
            for item, angles in zip(found.takes, mapped, strict=True)
        ),
    )


def noise_floor(found: Residuals, rotation: str) -> NoiseFloor | None:
    """The best estimate; None when the rotation was measured in fewer than three frames in a row."""
    return rotation_noise(found)[rotation].floor if rotation in found.measured_rotations else None


def _estimates(
    found: Residuals,
    rotation: str,
    doubts: Sequence[str],
    generator: np.random.Generator,
    limits: ComparisonLimits,
) -> tuple[NoiseFloor, ...]:
    """Every estimate that the takes allow, the best first. ``found``: of the plain map."""
    return tuple(_each_estimate(found, rotation, doubts, generator, limits))


def _each_estimate(
    found: Residuals,
    rotation: str,
    doubts: Sequence[str],
    generator: np.random.Generator,
    limits: ComparisonLimits,
) -> Iterator[NoiseFloor]:
    """As ``_estimates``; one after the other, for whoever wants only the best."""
    column = found.column(rotation)
    held = [holds(item, column, limits) for item in found.takes]
    every = [hold for of_take in held for hold in of_take]
    still = [hold for hold in every if hold.hand_is_still]
    slow, wandering, is_first = slow_sampling(found.takes, limits), (), True
    ways: tuple[Callable[[], NoiseFloor | None], ...] = (
        lambda: _from_holds(still, "still hand", generator, limits),
        lambda: _from_holds(every, "still joint", generator, limits),
        lambda: from_repeated_poses(found.takes, column, held, generator, limits),
        lambda: _of_plateau(error_spectrum(found, rotation, generator, limits)),
        lambda: _from_differences(found, column, generator, limits),
        lambda: _of_single_poses(found, column, generator, limits) if is_first else None,
    )
    for way in ways:
        one = way()
        if one is None:
            continue
        if is_first:
            wandering, is_first = hold_doubts(still, one.floor_deg, limits), False
        yield replace(one, reasons=(*doubts, *_of_estimate(one, slow, limits), *wandering))


def _of_plateau(spectrum: ErrorSpectrum | None) -> NoiseFloor | None:
    return None if spectrum is None else spectrum.plateau


def _of_single_poses(
    found: Residuals, column: int, generator: np.random.Generator, limits: ComparisonLimits
) -> NoiseFloor | None:
    """None where frames have neighbours, which tell more."""
    if any(_has_neighbours(item.take.time_s, limits) for item in found.takes):
        return None
    return from_near_readings(found.takes, column, generator, limits)


def _of_estimate(floor: NoiseFloor, slow: Sequence[str], limits: ComparisonLimits) -> tuple[str, ...]:
    """Single poses are compared with one another, not with the frames beside them."""
    if floor.how in ("repeated poses", "near readings"):
        return ()
    if floor.how not in ("still hand", "still joint") or floor.pieces >= limits.enough_holds:
        return tuple(slow)
    return (*slow, f"only {floor.pieces} holds, {limits.enough_holds} are needed")


def _from_holds(
    held: Sequence[Hold], how: How, generator: np.random.Generator, limits: ComparisonLimits
) -> NoiseFloor | None:
    """Without the holds that spread far more than most: something happened in them, which is no noise."""
    if len(held) < limits.fewest_holds:
        return None
    squares = np.array([hold.square(hold.error) for hold in held])
    freedom = np.array([hold.freedom for hold in held])
    usual = squares / freedom <= limits.disturbed_hold_times * np.median(squares / freedom)
    kept = [hold for hold, is_usual in zip(held, usual, strict=True) if is_usual]
    jitter = float(np.sqrt(sum(hold.square(hold.predicted) for hold in kept) / freedom[usual].sum()))
    return pooled(squares[usual], freedom[usual], jitter, how, generator)


def _from_differences(
    found: Residuals, column: int, generator: np.random.Generator, limits: ComparisonLimits
) -> NoiseFloor | None:
    """From second differences, which motion hardly enters; their variance is six times that of the noise."""
    takes = [item for item in found.takes if _has_neighbours(item.take.time_s, limits)]
    variances = _white_variances([np.diff(item.error[:, column], 2) for item in takes])
    if not len(variances):
        return None
    jitter = np.mean(_white_variances([np.diff(item.predicted[:, column], 2) for item in takes]))
    return pooled(variances, np.ones(len(variances)), float(np.sqrt(jitter)), "frame to frame", generator)


def _has_neighbours(time: np.ndarray, limits: ComparisonLimits) -> bool:
    return len(time) > 2 and float(np.median(np.diff(time))) <= limits.neighbours_s


def _white_variances(second: Sequence[np.ndarray]) -> np.ndarray:
    """Variance of the white noise in each of some 40 blocks of second differences, by their medians."""
    joined = np.concatenate([*second, np.zeros(0)])
    values = joined[np.isfinite(joined)] ** 2
    blocks = np.array_split(values, min(40, len(values))) if len(values) else []
    return np.array([np.median(block) for block in blocks]) / CHI_SQUARED_MEDIAN / 6.0


@dataclass(frozen=True)
class RotationNoise:
    floors: tuple[NoiseFloor, ...]
    """Every estimate that the takes allow, the best first."""
    spectrum: ErrorSpectrum | None

    @property
    def floor(self) -> NoiseFloor | None:
        """The best estimate."""
        return self.floors[0] if self.floors else None


def rotation_noise(
    found: Residuals, *, limits: ComparisonLimits = COMPARISON_LIMITS
) -> dict[str, RotationNoise]:
    """Of every measured rotation. Floors depend on the takes alone, spectra on the model's errors.

    A rotation's intervals do not depend on which others were measured.
    """
    plain, result = _of_plain_map(found), {}
    doubts = clock_doubts(found.takes, limits)
    for rotation in found.measured_rotations:
        floors = _estimates(plain, rotation, doubts, _generator(rotation), limits)
        floors = tuple(filter(None, (_with_stated(one, plain, rotation) for one in floors or (None,))))
        result[rotation] = RotationNoise(
            floors, error_spectrum(found, rotation, _generator(rotation), limits)
        )
    return result


def takes_noise(
    takes: Sequence[Take], rotations: Sequence[str], limits: ComparisonLimits = COMPARISON_LIMITS
) -> dict[str, NoiseFloor]:
    """The floor of each rotation of which it is known: as ``rotation_noise`` has it, without a model."""
    return _best_floors(plain_residuals(takes, rotations), limits)


def noise_floors(found: Residuals, limits: ComparisonLimits = COMPARISON_LIMITS) -> dict[str, NoiseFloor]:
    """The floor of each rotation of which it is known: as ``rotation_noise`` has it, without the rest."""
    return _best_floors(_of_plain_map(found), limits)


def _best_floors(plain: Residuals, limits: ComparisonLimits) -> dict[str, NoiseFloor]:
    doubts, floors = clock_doubts(plain.takes, limits), {}
    for rotation in plain.measured_rotations:
        best = next(_each_estimate(plain, rotation, doubts, _generator(rotation), limits), None)
        best = _with_stated(best, plain, rotation)
        if best is not None:
            floors[rotation] = best
    return floors


def _with_stated(floor: NoiseFloor | None, found: Residuals, rotation: str) -> NoiseFloor | None:
    stated = found.stated_deg(rotation)
    if stated is None:
        return floor
    return stated_floor(stated, len(found.takes)) if floor is None else floor.with_stated(stated)


def _generator(rotation: str) -> np.random.Generator:
    return np.random.default_rng([0, *rotation.encode()])


def is_at_floor(
    rmse_deg: float, floor: NoiseFloor | None, limits: ComparisonLimits = COMPARISON_LIMITS
) -> bool:
    """False where no floor is known, or only a lower bound of one, or one that is not reliable."""
    if floor is None or floor.is_lower_bound or not floor.beside(rmse_deg).is_reliable:
        return False
    return reaches_floor(rmse_deg, floor.high_deg, limits)


def reaches_floor(rmse_deg: float, high_deg: float, limits: ComparisonLimits = COMPARISON_LIMITS) -> bool:
    """``high_deg``: the upper end of the floor's 95 % interval."""
    return rmse_deg <= limits.at_floor_times * high_deg


# A plain map from the readings to the angles, the same whatever model is looked at.
#
# A noise floor belongs to the measurements. Taken from a model's residuals it would follow the model: one
# that
# has learned its takes by heart would have a floor of zero. So it is taken from what an additive model
# leaves:
# a cubic of every sensor, and a constant for each wearing (Hastie and Tibshirani 1990).


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


# The noise floor of a table of single poses: frames with nearly the same readings, paired.
#
# Rough, and from above: what the readings still differ by is included.


MOST_FRAMES = 1500


def from_near_readings(
    takes: Sequence[TakeResiduals],
    column: int,
    generator: np.random.Generator,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> NoiseFloor | None:
    """From pairs of frames of any take; None with fewer than ``fewest_pairs``."""
    error = np.concatenate([item.error[:, column] for item in takes])
    predicted = np.concatenate([item.predicted[:, column] for item in takes])
    names = takes[0].take.sensors
    if any(set(item.take.sensors) != set(names) for item in takes):
        return None
    readings = np.concatenate(
        [item.take.readings[:, [item.take.sensors.index(name) for name in names]] for item in takes]
    )
    rows = np.flatnonzero(np.isfinite(error))
    if len(rows) > MOST_FRAMES:
        rows = np.sort(generator.choice(rows, MOST_FRAMES, replace=False))
    first, second = _nearest_pairs(readings[rows])
    if len(first) < limits.fewest_pairs:
        return None
    first, second = rows[first], rows[second]
    jitter = float(np.sqrt(np.mean((predicted[first] - predicted[second]) ** 2) / 2))
    squares = (error[first] - error[second]) ** 2 / 2
    return pooled(squares, np.ones(len(squares)), jitter, "near readings", generator)


def _nearest_pairs(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both members of each pair: a frame and the one nearest to it, where that is nearer than for most."""
    spread = readings.std(axis=0) if len(readings) else np.zeros(0)
    scaled = readings[:, spread > 0] / spread[spread > 0]
    if len(scaled) < 2 or not scaled.shape[1]:
        return np.empty(0, dtype=int), np.empty(0, dtype=int)
    squares = np.sum(scaled**2, axis=1)
    distance = squares[:, None] + squares[None] - 2 * scaled @ scaled.T
    np.fill_diagonal(distance, np.inf)
    nearest = distance.argmin(axis=1)
    closest = distance[np.arange(len(scaled)), nearest]
    chosen = np.flatnonzero(closest <= np.median(closest))
    pairs = np.unique(np.sort(np.column_stack([chosen, nearest[chosen]]), axis=1), axis=0)
    return pairs[:, 0], pairs[:, 1]
