"""Whether what was recorded can be used; each reason is a sentence that says what to do better.

A step is judged by itself. In the end the same poses are held against those at the start: a sensor that reads
otherwise has moved on the hand, or drifted. A person does not take a pose again exactly, so a sensor is named
only when every pose says the same of it, and only where the pose itself holds the joint: the fingers' flexion
in flat and fist.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import Step
from glovecal_models.sampling.reading import ActiveRanges, GloveReading, moved_percent
from glovecal_models.sampling.state import SamplingState
from glovecal_models.sampling.steps import usual_angles


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
