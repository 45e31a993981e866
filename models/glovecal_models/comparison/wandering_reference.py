"""A reference that wanders slowly against the sensors, in one take of several.

All takes share one map with squares and products of their sensors, and each has a level of its own. Of each
take and rotation it is asked how much of what the map leaves a slow change with time takes away. A warm-up,
creep or a slip change with time too: they do so in most takes, or on the one sensor of a joint, of which
nothing is said here: only where more sensors than rotations see the hand do they bear witness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from glovecal_models.comparison.limits import ComparisonLimits
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

FEWEST_TAKES, FEWEST_SLOW_ROWS, MOST_SLOW_ROWS = 3, 40, 300
MOST_WITH_PRODUCTS = 6
"""Sensors; of more, lines alone."""
SLOW_RIDGE = 1e-5
TIMES_AS_MANY = 2
"""Sensors as rotations."""
SHORTEST_SLOW_S = 4.0
"""In a shorter take a slow change is the movement itself."""


@dataclass(frozen=True)
class Wandering:
    """A take whose reference wanders."""

    place: int
    rotation: str
    by_deg: float
    """From its lowest to its highest."""
    off_deg: float
    """What the map leaves of the take, RMS; ``fitted_deg`` without the wandering."""
    usual_deg: float
    """What it leaves of all takes then."""
    fitted_deg: float


def wandering_references(
    takes: Sequence[Take], usable: Sequence[str], layout: Layout, limits: ComparisonLimits
) -> list[Wandering]:
    """The clearest one, or none, by ``usable`` sensors."""
    read = {name: layout.correspondence(name).sensors for name in layout.rotations}
    if len(takes) < FEWEST_TAKES or len(usable) < TIMES_AS_MANY * len(layout.rotations):
        return []
    found = []
    for rotation in layout.rotations:
        sensors = [name for name in read[rotation] if name in usable]
        if len(sensors) > 1:
            found += _of_rotation(takes, rotation, sensors, limits)
    return [min(found, key=lambda item: item.fitted_deg / item.off_deg)] if found else []


def _of_rotation(
    takes: Sequence[Take], rotation: str, sensors: Sequence[str], limits: ComparisonLimits
) -> list[Wandering]:
    places, parts = [], []
    for place, take in enumerate(takes):
        rows = _rows(take, rotation, sensors)
        if rows is not None:
            places.append(place)
            parts.append(rows)
    if len(places) < FEWEST_TAKES:
        return []
    of = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    time, x, angle = (np.concatenate(column) for column in zip(*parts, strict=True))
    columns = np.column_stack([_shapes(x), *((of == each).astype(float) for each in range(len(parts)))])
    square = columns.T @ columns + SLOW_RIDGE * len(columns) * np.eye(columns.shape[1])

    def left(values: np.ndarray) -> np.ndarray:
        return values - columns @ np.linalg.solve(square, columns.T @ values)

    before, slow = left(angle), []
    for number in range(len(parts)):
        mine = of == number
        shape = np.where(mine[:, None], np.column_stack([time, time**2]), 0.0)
        rest = left(shape)
        weight = np.linalg.lstsq(rest, before, rcond=None)[0]
        after = before - rest @ weight
        slow.append((float(np.ptp(shape[mine] @ weight)), _rms(before[mine]), _rms(after[mine]), _rms(after)))
    found = []
    for number, (by, off, fitted, all_of) in enumerate(slow):
        others = max(each[0] for place, each in enumerate(slow) if place != number)
        if (
            by >= max(limits.wandering_deg, limits.wandering_times * others)
            and fitted <= limits.wandering_share * off
        ):
            found.append(Wandering(places[number], rotation, by, off, all_of, fitted))
    return found


def _rows(
    take: Take, rotation: str, sensors: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Times from -1 to 1, readings and angles; None where too few were measured."""
    if rotation not in take.rotations:
        return None
    angle = take.reference_at_frames([rotation])[:, 0]
    rows = np.flatnonzero(np.isfinite(angle))
    if len(rows) < FEWEST_SLOW_ROWS or take.time_s[rows[-1]] - take.time_s[rows[0]] < SHORTEST_SLOW_S:
        return None
    rows = rows[np.linspace(0, len(rows) - 1, min(MOST_SLOW_ROWS, len(rows))).astype(int)]
    time = take.time_s[rows]
    readings = take.readings[rows][:, [take.sensors.index(name) for name in sensors]]
    return 2 * (time - time[0]) / (time[-1] - time[0]) - 1, readings, angle[rows]


def _shapes(readings: np.ndarray) -> np.ndarray:
    """(N, C) of readings (N, S): themselves, and of few sensors squares and products."""
    x = (readings - readings.mean(axis=0)) / np.maximum(readings.std(axis=0), 1e-9)
    if x.shape[1] > MOST_WITH_PRODUCTS:
        return x
    pairs = combinations_with_replacement(range(x.shape[1]), 2)
    return np.column_stack([x, *(x[:, one] * x[:, other] for one, other in pairs)])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
