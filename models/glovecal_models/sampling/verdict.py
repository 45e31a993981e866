"""What is to be thought of a recorded step: its frames by themselves, then beside the other steps.

A rotation's widgets agree when what its sensor reads rises, or falls, with the angle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import Step
from glovecal_models.sampling.quality import faults, missing_frames
from glovecal_models.sampling.reading import ActiveRanges, GloveReading, block_means
from glovecal_models.sampling.state import Attempt, SamplingState

KEPT_OF_RANGE, KEPT_OF_MOTION = 64, 12


class TouchCheck(Protocol):
    """Inverse kinematics can tell whether fingertips touched; ``state`` is that before the verdict."""

    def learn(self, state: SamplingState, step: Step, readings: Sequence[GloveReading]) -> None:
        """Take in the frames of a good step."""
        ...

    def why_not(self, state: SamplingState, step: Step, readings: Sequence[GloveReading]) -> str | None:
        """Why the fingertips of a step did not touch, in a sentence."""
        ...


def verdict(
    state: SamplingState,
    readings: Sequence[GloveReading],
    ranges: ActiveRanges,
    recording: str,
    touch_check: TouchCheck | None = None,
    limits: SamplingLimits = SAMPLING_LIMITS,
) -> Attempt:
    """The attempt at the step that ``state`` stands at. ``ranges`` learn from good frames."""
    step = state.now()
    attempt = Attempt(step.name, "good", recording=recording, frames=len(readings))
    if readings:
        attempt.begins_s, attempt.ends_s = readings[0].time_s, readings[-1].time_s
        attempt.missing = missing_frames(readings)
        means = np.mean([reading.values for reading in readings], axis=0)
        attempt.means = dict(zip(state.sensors, means.tolist(), strict=True))
    if step.kind == "range":
        _widen(ranges, readings)
    attempt.reasons = faults(step, readings, state.sensors, ranges, _flat(state), limits)
    if readings:
        percent = 100 * np.ptp([reading.values for reading in readings], axis=0) / ranges.span
        attempt.moved_percent = float(percent.max())
    if state.protocol.grows:
        attempt.kept = kept_readings(step, readings)
    if not attempt.reasons:
        _widen(ranges, readings)
        attempt.reasons = _contradictions(state, readings, ranges, attempt, touch_check, limits)
    attempt.outcome = "bad" if attempt.reasons else "good"
    if touch_check is not None and attempt.outcome == "good":
        touch_check.learn(state, step, readings)
    return attempt


def _widen(ranges: ActiveRanges, readings: Sequence[GloveReading]) -> None:
    ranges.widen(block_means(readings)[:-1])  # the last block may be as noisy as a frame


def _contradictions(
    state: SamplingState,
    readings: Sequence[GloveReading],
    ranges: ActiveRanges,
    attempt: Attempt,
    touch_check: TouchCheck | None,
    limits: SamplingLimits,
) -> tuple[str, ...]:
    """What only the other steps, or inverse kinematics, can tell."""
    step, sentence = state.now(), None
    if step.repeats and step.motion == "move":
        attempt.response = response(state.protocol.step(step.repeats), readings, state.sensors, ranges)
    elif step.kind == "fk_cross_couple":
        attempt.response = response(step, readings, state.sensors, ranges)
        (rotation,) = step.angles
        sentence = inconsistent_widgets(rotation, _responses(state, rotation, attempt), limits)
    elif step.touches and touch_check is not None:
        sentence = touch_check.why_not(state, step, readings)
    return (sentence,) if sentence else ()


def _responses(state: SamplingState, rotation: str, attempt: Attempt) -> dict[float, float]:
    """What the rotation's sensor answered to each of its widgets, by degrees."""
    tried = {**state.finished(), attempt.step: attempt}
    responses: dict[float, float] = {}
    for step in state.protocol.steps:
        found = tried.get(step.name)
        same = step.kind == "fk_cross_couple" and rotation in step.angles
        if same and found is not None and found.response is not None:
            responses[step.angles[rotation]] = found.response
    return responses


def _flat(state: SamplingState) -> dict[str, float] | None:
    finished = state.finished()
    for step in state.protocol.steps:
        if step.pose == "flat" and step.name in finished and finished[step.name].means:
            return finished[step.name].means
    return None


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


def inconsistent_widgets(
    rotation: str, responses: Mapping[float, float], limits: SamplingLimits = SAMPLING_LIMITS
) -> str | None:
    """A sentence when the readings by angle (degrees) contradict each other, else None.

    With four widgets the one that is wrong can be named: without it the others lie on a line.
    """
    if len(responses) < limits.widget_fewest:
        return None
    angles = np.array(sorted(responses))
    reading = np.array([responses[angle] for angle in angles.tolist()])
    rises = np.diff(reading)
    monotone = bool((rises > 0).all() or (rises < 0).all())
    if len(angles) == limits.widget_fewest:
        return None if monotone else _contradiction(rotation, angles)
    told = [_told_by_others(angles, reading, place) for place in range(len(angles))]
    place = min(range(len(angles)), key=lambda at: told[at][1])
    says = told[place][0]
    if monotone and abs(says - angles[place]) <= limits.widget_step_share * float(np.diff(angles).min()):
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


def kept_readings(step: Step, readings: Sequence[GloveReading]) -> list[list[float]]:
    """What a step leaves in the state for choosing: its mean reading, or some spread over its motion."""
    values = np.array([reading.values for reading in readings], float)
    if not len(values):
        return []
    if step.motion == "hold":
        values = values.mean(axis=0)[None]
    most = KEPT_OF_RANGE if step.kind == "range" else KEPT_OF_MOTION
    chosen = np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int)
    return values[chosen].round(2).tolist()
