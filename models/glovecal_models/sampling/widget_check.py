"""Whether a rotation's widgets agree: what its sensor reads must rise, or fall, with the angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.sampling.reading import GloveReading
from glovecal_models.sampling.steadiness import ActiveRanges, block_means
from glovecal_models.sampling.step import Step

FEWEST = 3
"""Two angles always agree."""
ALLOWED_STEP = 0.7
"""Of the smallest step between widgets: no sensor is quite straight."""


def response(
    step: Step, readings: Sequence[GloveReading], sensors: Sequence[str], ranges: ActiveRanges
) -> float | None:
    """What the held rotation's own sensor reads with its neighbours half bent; None if it has no sensor.

    The angle does not change within the step, so a plane through its frames tells what the neighbours do.
    """
    (rotation,) = step.angles
    if rotation not in sensors:
        return None
    means, own = block_means(readings), sensors.index(rotation)
    others = [sensors.index(sensor) for sensor in step.moves]
    away = (means[:, others] - ranges.middle[others]) / ranges.span[others]
    design = np.column_stack([np.ones(len(means)), away])
    # A little ridge: fingers that move together do not tell which of them pulls.
    ridge = np.diag([0.0, *[0.01 * len(means)] * len(others)])
    return float(np.linalg.solve(design.T @ design + ridge, design.T @ means[:, own])[0])


def inconsistent_widgets(rotation: str, responses: Mapping[float, float]) -> str | None:
    """A sentence when the readings by angle (degrees) contradict each other, else None.

    With four widgets the one that is wrong can be named: without it the others lie on a line.
    """
    if len(responses) < FEWEST:
        return None
    angles = np.array(sorted(responses))
    reading = np.array([responses[angle] for angle in angles.tolist()])
    rises = np.diff(reading)
    monotone = bool((rises > 0).all() or (rises < 0).all())
    if len(angles) == FEWEST:
        return None if monotone else _contradiction(rotation, angles)
    told = [_told_by_others(angles, reading, place) for place in range(len(angles))]
    place = min(range(len(angles)), key=lambda at: told[at][1])
    says = told[place][0]
    if monotone and abs(says - angles[place]) <= ALLOWED_STEP * float(np.diff(angles).min()):
        return None
    if not np.isfinite(says):
        return _contradiction(rotation, angles)
    return (
        f"{rotation} at {angles[place]:g} degrees reads like about {says:.0f} degrees by the other widgets: "
        "is it another widget, or was its angle typed wrong?"
    )


def _told_by_others(angles: np.ndarray, reading: np.ndarray, place: int) -> tuple[float, float]:
    """The angle that the other widgets' line gives this one's reading, and how badly they fit the line."""
    others = np.arange(len(angles)) != place
    slope, start = np.polyfit(angles[others], reading[others], 1)
    if slope == 0:
        return float("inf"), float("inf")
    misfit = np.abs((reading[others] - start) / slope - angles[others]).max()
    return float((reading[place] - start) / slope), float(misfit)


def _contradiction(rotation: str, angles: np.ndarray) -> str:
    told = ", ".join(f"{angle:g}" for angle in angles)
    return (
        f"{rotation} at {told} degrees: the sensor neither rises nor falls all the way; one of these widgets "
        "is another one, or its angle was typed wrong."
    )
