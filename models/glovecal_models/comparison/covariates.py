"""What an error may depend on: the columns that residuals are held against."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.residuals import Residuals, TakeResiduals

POWER_ON = "power_on_s"
"""The context column of seconds since the glove was switched on."""
UNITS = {"v": "V", "c": "°C", "pct": "%", "s": "s", "n": "N", "g": "g"}
"""What the end of a context column's name says of its unit: ``supply_v`` is in volts."""
WINDOW_S = 0.1
"""Angle and speed are taken over about this long: shorter, they show the noise of the reference."""


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
