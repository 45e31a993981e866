"""What is to be thought of a recorded step: its frames by themselves, then beside the other steps.

A rotation's widgets agree when what its sensor reads rises, or falls, with the angle.

Whether what was recorded can be used; each reason is a sentence that says what to do better.

A step is judged by itself. In the end the same poses are held against those at the start: a sensor that reads
otherwise has moved on the hand, or drifted. A person does not take a pose again exactly, so a sensor is named
only when every pose says the same of it, and only where the pose itself holds the joint: the fingers' flexion
in flat and fist.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import Step, usual_angles
from glovecal_models.sampling.state import (
    ActiveRanges,
    Attempt,
    GloveReading,
    SamplingState,
    block_means,
    moved_percent,
)

KEPT_OF_RANGE, KEPT_OF_MOTION = 64, 12


def faults(
    step: Step,
    readings: Sequence[GloveReading],
    sensors: Sequence[str],
    ranges: ActiveRanges,
    flat: Mapping[str, float] | None = None,
    limits: SamplingLimits = SAMPLING_LIMITS,
) -> tuple[str, ...]:
    """Why these frames of ``step`` cannot be used; empty when they can.

    ``flat`` is the mean reading by sensor of the flat hand, when it was recorded: nobody touches the thumb
    with a flat finger.
    """
    lost = _missing_frames(readings, limits)
    if lost:
        return lost
    jumped = _jumps(readings, sensors, ranges, limits)
    if jumped:
        return jumped
    moved = dict(zip(sensors, moved_percent(readings, ranges).tolist(), strict=True))
    if step.motion == "hold":
        return _not_still(moved, limits.still_percent)
    if step.kind == "range":
        return _dead(readings, sensors, limits.dead_share * ranges.least)
    bent = _never_bent(step, readings, sensors, ranges, flat, limits.bent_percent)
    return (*_hardly_moved(step, moved, limits), *bent)


def missing_frames(readings: Sequence[GloveReading]) -> int:
    """Numbers left out of the sequence."""
    if not readings:
        return 0
    first, last = readings[0].sequence, readings[-1].sequence
    return max(0, last - first + 1 - len(readings))


def _missing_frames(readings: Sequence[GloveReading], limits: SamplingLimits) -> tuple[str, ...]:
    if len(readings) < limits.fewest_frames:
        return (f"only {len(readings)} frames came; {limits.fewest_frames} are needed.",)
    if len({reading.run for reading in readings}) > 1:
        return ("the capture daemon was started again meanwhile.",)
    missing = missing_frames(readings)
    if missing > limits.most_missing_share * (missing + len(readings)):
        return (f"{missing} of {missing + len(readings)} frames did not arrive.",)
    silence = float(np.diff([reading.time_s for reading in readings]).max())
    if silence > limits.longest_silence_s:
        return (f"the glove was silent for {silence:.1f} s.",)
    return ()


def _jumps(
    readings: Sequence[GloveReading], sensors: Sequence[str], ranges: ActiveRanges, limits: SamplingLimits
) -> tuple[str, ...]:
    time_s = np.array([reading.time_s for reading in readings])
    values = np.array([reading.values for reading in readings], float)
    step = 100 * np.abs(np.diff(values, axis=0)) / ranges.span
    allowed = np.maximum(limits.jump_percent, limits.fastest_percent_s * np.diff(time_s))[:, None]
    beyond = step - allowed
    if beyond.max() <= 0:
        return ()
    frame, sensor = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    at_s = time_s[frame + 1] - time_s[0]
    return (
        f"sensor {sensors[int(sensor)]} jumped by {step[frame, sensor]:.0f} % of its range after {at_s:.1f} s"
        ": a loose wire, or the glove slipped.",
    )


def _not_still(moved: Mapping[str, float], still_percent: float) -> tuple[str, ...]:
    worst = max(moved, key=lambda sensor: moved[sensor])
    if moved[worst] <= still_percent:
        return ()
    return (
        f"the hand moved: {worst} by {moved[worst]:.1f} % of its range; {still_percent:g} % are allowed.",
    )


def _hardly_moved(step: Step, moved: Mapping[str, float], limits: SamplingLimits) -> tuple[str, ...]:
    needed = limits.touching_percent if step.touches else limits.moved_percent
    far = 2 * limits.moved_percent
    lazy = [sensor for sensor in step.moves if moved[sensor] < needed]
    thumb = [sensor for sensor in step.moves if sensor.startswith("T")]
    other = [sensor for sensor in moved if sensor.startswith("P_") and moved[sensor] >= far]
    if thumb and len(lazy) == len(step.moves) and other:
        return (
            f"{other[0]} moved through {moved[other[0]]:.0f} % of its range and the thumb's sensors did not: "
            "is this a glove of the other hand?",
        )
    return tuple(
        f"{sensor} went through {moved[sensor]:.0f} % of its range only; {needed:g} % are needed."
        for sensor in lazy
    )


def _dead(readings: Sequence[GloveReading], sensors: Sequence[str], least: float) -> tuple[str, ...]:
    went = np.ptp(np.array([reading.values for reading in readings], float), axis=0)
    return tuple(
        f"sensor {sensor} did not move ({width:g} from lowest to highest reading): is it plugged in?"
        for sensor, width in zip(sensors, went.tolist(), strict=True)
        if width <= least
    )


def _never_bent(
    step: Step,
    readings: Sequence[GloveReading],
    sensors: Sequence[str],
    ranges: ActiveRanges,
    flat: Mapping[str, float] | None,
    bent_percent: float,
) -> tuple[str, ...]:
    if not step.touches or flat is None:
        return ()
    mean = np.mean([reading.values for reading in readings], axis=0)
    reasons = []
    for finger in step.touches[1:]:
        own = [place for place, name in enumerate(sensors) if name in (f"{finger}_MCP", f"{finger}_PIP")]
        bent = [100 * abs(mean[place] - flat[sensors[place]]) / ranges.span[place] for place in own]
        if bent and max(bent) < bent_percent:
            reasons.append(
                f"the finger is {max(bent):.0f} % of its range from flat: it did not touch the thumb."
            )
    return tuple(reasons)


def moved_since_start(
    state: SamplingState, ranges: ActiveRanges, limits: SamplingLimits = SAMPLING_LIMITS
) -> list[str]:
    """A sentence for each sensor that has moved, or one if none has; nothing without two poses twice."""
    changes = _changes(state, ranges)
    if len(changes) < 2:
        return []
    each = np.array(changes)
    alike = (each > 0).all(axis=0) | (each < 0).all(axis=0)
    least = np.where(alike, np.abs(each).min(axis=0), 0.0)
    held = [sensor in usual_angles()["flat"] for sensor in state.sensors]
    same = limits.same_percent
    moved = [place for place in np.flatnonzero(held).tolist() if least[place] > same]
    if not moved:
        return [f"The poses read the same at the end as at the start, within {same:g} % of range."]
    return [
        f"{state.sensors[place]} reads otherwise at the end, in every pose by at least {least[place]:.0f} % "
        "of its range: the glove has moved on the hand, or its readings drift."
        for place in moved
    ]


def _changes(state: SamplingState, ranges: ActiveRanges) -> list[np.ndarray]:
    """End less start by pose, percent of each sensor's range, shape (S,)."""
    finished = state.finished()
    means = {
        (step.part, step.pose): finished[step.name].means
        for step in state.protocol.steps
        if step.name in finished and finished[step.name].means
    }
    changes = []
    for (part, pose), after in means.items():
        before = means.get(("verification-start", pose))
        if part == "verification-end" and before is not None:
            difference = [after[sensor] - before[sensor] for sensor in state.sensors]
            changes.append(100 * np.array(difference) / ranges.span)
    return changes


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
