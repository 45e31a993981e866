"""How far each sensor reads while its own joint goes through its active range: the scale of every per cent.

Crosstalk of its neighbours lets a sensor read farther than its own joint alone. So the best source is a
take in which that joint moved alone; then the sensor's slope over measured angles, times the angles seen;
then all that was read in range takes, the neighbours' crosstalk included; at last what the hardware can send.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from glovecal_models.independence.smooth_readings import SmoothTake, span
from glovecal_models.independence.still_rotation import rotation_in_name
from glovecal_models.layout import Layout

RangeSource = Literal["its own range take", "measured angles", "all that was read", "what the glove can send"]
SEEN_SHARE = 0.6
"""Of a healthy hand's active range: with less, a range is not seen."""


@dataclass(frozen=True)
class ActiveRange:
    sensor: str
    readings: float
    """Readings between the two ends of the range; 0 when nothing is known."""
    source: RangeSource
    angle_deg: float | None
    """How far the joint went, degrees, where it was measured."""
    has_moved: bool
    """False: the sensor read nothing but noise in these takes."""


def active_ranges(layout: Layout, takes: Sequence[SmoothTake]) -> dict[str, ActiveRange]:
    """One for each sensor of the layout, from takes in which joints went through their ranges."""
    return {sensor: _active_range(sensor, layout, takes) for sensor in layout.sensors}


def measured_slope(item: SmoothTake, sensor: str, layout: Layout) -> tuple[float, float] | None:
    """Readings per degree of the sensor's own rotation, and its standard error; None where the take cannot
    tell. Rotations of the sensors that the layout reads beside it are accounted for.

    Ordinary least squares; the error is doubled, as neighbouring frames err alike."""
    own = item.angle(sensor)
    if own is None or sensor not in layout.rotations:
        return None
    others = [item.angle(name) for name in layout.correspondence(sensor).sensors if name != sensor]
    columns = np.column_stack([own, *(one for one in others if one is not None and span(one) > 1.0)])
    known = np.isfinite(columns).all(axis=1)
    if known.sum() < 4 * columns.shape[1] or span(own[known]) < 1.0:
        return None
    centred = columns[known] - columns[known].mean(axis=0)
    reading = item.reading(sensor)[known]
    slopes, _, rank, _ = np.linalg.lstsq(centred, reading - reading.mean(), rcond=1e-6)
    if rank < columns.shape[1]:
        return None
    left = float((reading - reading.mean() - centred @ slopes).std())
    spread = np.linalg.inv(centred.T @ centred)[0, 0]
    return float(slopes[0]), float(np.sqrt(spread) * left * 2)


def _active_range(sensor: str, layout: Layout, takes: Sequence[SmoothTake]) -> ActiveRange:
    holding = [item for item in takes if sensor in item.take.sensors]
    own = [item for item in holding if rotation_in_name(item.take.name, layout.rotations) == sensor]
    angle = max((span(a) for item in holding if (a := item.angle(sensor)) is not None), default=None)
    readings, source = max((span(item.reading(sensor)) for item in own), default=0.0), "its own range take"
    if not own:
        readings, source = _by_slope(sensor, holding, layout), "measured angles"
    if not readings and holding:
        readings, source = _all_read(sensor, holding), "all that was read"
    moved = any(item.has_moved(sensor) for item in holding)
    if not moved and layout.counts is not None:
        readings, source = layout.counts[1] - layout.counts[0], "what the glove can send"
    readings = readings if moved or layout.counts is not None else 0.0
    return ActiveRange(sensor, readings, source, angle, moved)


def _by_slope(sensor: str, takes: Sequence[SmoothTake], layout: Layout) -> float:
    """Slope times the angles seen, of the take that saw most of them."""
    best = 0.0
    for item in takes:
        found, own = measured_slope(item, sensor, layout), item.angle(sensor)
        if found is not None and own is not None and abs(found[0]) > 3 * found[1]:
            best = max(best, abs(found[0]) * span(own))
    return best


def _all_read(sensor: str, takes: Sequence[SmoothTake]) -> float:
    """Widest of all takes: readings shift between wearings, so takes are not thrown together."""
    return max(span(item.reading(sensor)) for item in takes)
