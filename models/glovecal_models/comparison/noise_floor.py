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

The floor is that of this model: one that follows its sensors too closely amplifies their noise. The
prediction's own jitter is reported beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.error_spectrum import ErrorSpectrum, error_spectrum
from glovecal_models.comparison.floor_estimate import How, NoiseFloor, pooled
from glovecal_models.comparison.holds import Hold, from_repeated_poses, holds
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import Residuals, TakeResiduals

CHI_SQUARED_MEDIAN = 0.4549
"""With one degree of freedom."""
MOST_FRAMES = 1500


def noise_floor(found: Residuals, rotation: str, generator: np.random.Generator) -> NoiseFloor | None:
    """The best estimate; None when the rotation was measured in fewer than three frames in a row."""
    return next(iter(noise_floors(found, rotation, generator)), None)


def noise_floors(
    found: Residuals,
    rotation: str,
    generator: np.random.Generator,
    spectrum: ErrorSpectrum | None = None,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> tuple[NoiseFloor, ...]:
    """Every estimate that the takes allow, the best first. ``spectrum`` spares its computation."""
    column = found.column(rotation)
    held = [holds(item, column, limits) for item in found.takes]
    every = [hold for of_take in held for hold in of_take]
    still = [hold for hold in every if hold.hand_is_still]
    spectrum = spectrum or error_spectrum(found, rotation, generator, limits)
    estimates = (
        _from_holds(still, "still hand", generator, limits),
        _from_holds(every, "still joint", generator, limits),
        from_repeated_poses(found.takes, column, held, generator, limits),
        spectrum.plateau if spectrum is not None else None,
        _from_differences(found, column, generator, limits),
    )
    some = tuple(one for one in estimates if one is not None)
    if some or any(_has_neighbours(item.take.time_s, limits) for item in found.takes):
        return some
    single = from_near_readings(found.takes, column, generator, limits)
    return () if single is None else (single,)


def _from_holds(
    held: Sequence[Hold], how: How, generator: np.random.Generator, limits: ComparisonLimits
) -> NoiseFloor | None:
    if len(held) < limits.fewest_holds:
        return None
    squares = np.array([hold.square(hold.error) for hold in held])
    freedom = np.array([hold.freedom for hold in held])
    jitter = float(np.sqrt(sum(hold.square(hold.predicted) for hold in held) / freedom.sum()))
    return pooled(squares, freedom, jitter, how, generator)


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
    found: Residuals, *, seed: int = 0, limits: ComparisonLimits = COMPARISON_LIMITS
) -> dict[str, RotationNoise]:
    """Of every measured rotation. A rotation's intervals do not depend on which others were measured."""
    result = {}
    for rotation in found.measured_rotations:
        generator = np.random.default_rng([seed, *rotation.encode()])
        spectrum = error_spectrum(found, rotation, generator, limits)
        floors = noise_floors(found, rotation, generator, spectrum, limits)
        result[rotation] = RotationNoise(floors, spectrum)
    return result


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


def is_at_floor(
    rmse_deg: float, floor: NoiseFloor | None, limits: ComparisonLimits = COMPARISON_LIMITS
) -> bool:
    """False where no floor is known, or only a lower bound of one."""
    if floor is None or floor.is_lower_bound:
        return False
    return reaches_floor(rmse_deg, floor.high_deg, limits)


def reaches_floor(rmse_deg: float, high_deg: float, limits: ComparisonLimits = COMPARISON_LIMITS) -> bool:
    """``high_deg``: the upper end of the floor's 95 % interval."""
    return rmse_deg <= limits.at_floor_times * high_deg
