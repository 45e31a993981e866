"""How well the first pose or widget of a sampling is read again at its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import Step
from glovecal_models.sampling.reading import ActiveRanges
from glovecal_models.sampling.state import Attempt, SamplingState
from glovecal_models.sampling.steps import usual_angles

ANGLES_APART_DEG = 5.0
"""Angles that lie closer together give no counts per degree."""


@dataclass(frozen=True)
class SensorChange:
    """One sensor at the end less at the start."""

    sensor: str
    counts: float
    percent: float
    """Of the sensor's active range."""
    degrees: float | None
    """By a straight line through the angles of this sampling; None: it has no two for this sensor."""


@dataclass(frozen=True)
class Repeatability:
    """Of the step asked twice."""

    step: str
    apart_s: float
    """Between the two visits."""
    sensors: tuple[SensorChange, ...]
    rms_deg: float | None
    """Over the sensors whose change is known in degrees; None: none is."""
    rms_percent: float
    is_much: bool
    """More than a person's own repetition explains."""

    def sentence(self, limits: SamplingLimits = SAMPLING_LIMITS) -> str:
        worst = max(self.sensors, key=lambda item: abs(item.percent))
        size = f"{self.rms_percent:.1f} % of the active range RMS"
        size = f"{size} (worst {worst.sensor}: {worst.counts:+.1f} counts)"
        scale = f"a pose repeats within about {limits.repeat_percent:g} %"
        if self.rms_deg is not None:
            worst = max(self.sensors, key=lambda item: abs(item.degrees or 0.0))
            counted = f"{worst.degrees:+.1f} degrees, {worst.counts:+.1f} counts"
            size = f"{self.rms_deg:.1f} degrees RMS (worst {worst.sensor}: {counted})"
            scale = f"a person repeats a pose within about {limits.repeat_deg:g} degrees"
        told = f"{self.step} again after {self.apart_s / 60:.1f} min differs by {size}; {scale}."
        if self.is_much:
            return f"{told} The glove has moved on the hand, or its readings drift."
        return told


def repeatability(state: SamplingState, limits: SamplingLimits = SAMPLING_LIMITS) -> Repeatability | None:
    """None until a step was done twice; a sensor that the step leaves free says nothing."""
    finished = state.finished()
    for step in state.protocol.steps:
        both = finished.get(step.repeats), finished.get(step.name)
        if step.repeats and both[0] is not None and both[1] is not None:
            return _compared(state, state.protocol.step(step.repeats), both[0], both[1], limits)
    return None


def _compared(
    state: SamplingState, step: Step, first: Attempt, last: Attempt, limits: SamplingLimits
) -> Repeatability | None:
    if first.begins_s is None or last.begins_s is None or not first.means or not last.means:
        return None
    if step.motion == "hold":
        held = set(step.angles) or set(usual_angles()["flat"])
        changes = {
            sensor: last.means[sensor] - first.means[sensor]
            for sensor in [name for name in state.sensors if name in held] or state.sensors
        }
    elif first.response is not None and last.response is not None:
        (rotation,) = step.angles
        changes = {rotation: last.response - first.response}
    else:
        return None
    span = dict(zip(state.sensors, ActiveRanges.from_document(state.ranges).span.tolist(), strict=True))
    found = []
    for sensor, counts in changes.items():
        slope = _counts_per_degree(state, sensor)
        degrees = None if slope is None else counts / slope
        found.append(SensorChange(sensor, counts, 100 * counts / span[sensor], degrees))
    known = [item.degrees for item in found if item.degrees is not None]
    rms_deg = float(np.sqrt(np.mean(np.square(known)))) if known else None
    rms_percent = float(np.sqrt(np.mean([item.percent**2 for item in found])))
    much, usual = (rms_percent, limits.repeat_percent) if rms_deg is None else (rms_deg, limits.repeat_deg)
    return Repeatability(
        step.name, last.begins_s - first.begins_s, tuple(found), rms_deg, rms_percent,
        much > limits.repeat_times * usual,
    )  # fmt: skip


def _counts_per_degree(state: SamplingState, rotation: str) -> float | None:
    """Of the sensor that has the rotation's name, from the sampling's own known angles."""
    finished, known = state.finished(), []
    for step in state.protocol.steps:
        attempt = finished.get(step.name)
        is_known = rotation in step.angles and not step.repeats
        if attempt is None or not is_known or attempt.outcome != "good":
            continue
        reading = attempt.means.get(rotation) if step.motion == "hold" else attempt.response
        if reading is not None:
            known.append((step.angles[rotation], reading))
    angles, readings = np.array(known).reshape(-1, 2).T
    if len(angles) < 2 or np.ptp(angles) < ANGLES_APART_DEG:
        return None
    slope = float(np.polyfit(angles, readings, 1)[0])
    return slope if slope else None
