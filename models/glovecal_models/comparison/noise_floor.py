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
  the reference differs between frames that read nearly the same.

The floor is that of this model: one that follows its sensors too closely magnifies their noise. How much of
the floor is the prediction's own jitter is told beside it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.comparison.error_spectrum import ErrorSpectrum, error_spectrum
from glovecal_models.comparison.floor_estimate import How, NoiseFloor, pooled
from glovecal_models.comparison.holds import Hold, holds
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.near_readings import from_near_readings
from glovecal_models.comparison.repeated_poses import from_repeated_poses
from glovecal_models.comparison.residuals import Residuals

CHI_SQUARED_MEDIAN = 0.4549
"""With one degree of freedom."""


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
