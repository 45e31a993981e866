"""Whether what was recorded can be used; each reason is a sentence that says what to do better.

A step is judged by itself. In the end the same poses are held against those at the start: a sensor that reads
otherwise has moved on the hand, or drifted. A person does not take a pose again exactly, so a sensor is named
only when every pose says the same of it, and only where the pose itself holds the joint: the fingers' flexion
in flat and fist.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.sampling.protocol import Step
from glovecal_models.sampling.reading import STILL_PERCENT, ActiveRanges, GloveReading, moved_percent
from glovecal_models.sampling.state import SamplingState
from glovecal_models.sampling.steps import usual_angles

MOVED_PERCENT = 25.0
"""A sensor that had to move went at least so far."""
TOUCHING_PERCENT = 12.0
"""That of a finger whose tip stays on the thumb's: ring and little finger get no further than 20 %."""
JUMP_PERCENT = 12.0
FASTEST_PERCENT_S = 1500.0
"""A finger's hundred degrees in a fifteenth of a second: faster is no hand."""
LEAST_FRAMES = 10
MOST_MISSING = 0.2
LONGEST_SILENCE_S = 0.3
DEAD_SHARE = 0.2
"""Of the smallest sensible range: a sensor that shows less while everything moves is dead."""
BENT_PERCENT = 10.0


def faults(
    step: Step,
    readings: Sequence[GloveReading],
    sensors: Sequence[str],
    ranges: ActiveRanges,
    flat: Mapping[str, float] | None = None,
) -> tuple[str, ...]:
    """Why these frames of ``step`` cannot be used; empty when they can.

    ``flat`` is the mean reading by sensor of the flat hand, when it was recorded: nobody touches the thumb
    with a flat finger.
    """
    lost = _missing_frames(readings)
    if lost:
        return lost
    jumped = _jumps(readings, sensors, ranges)
    if jumped:
        return jumped
    moved = dict(zip(sensors, moved_percent(readings, ranges).tolist(), strict=True))
    if step.motion == "hold":
        return _not_still(moved)
    if step.kind == "range":
        return _dead(readings, sensors, ranges)
    return (*_hardly_moved(step, moved), *_never_bent(step, readings, sensors, ranges, flat))


def missing_frames(readings: Sequence[GloveReading]) -> int:
    """Numbers left out of the sequence."""
    if not readings:
        return 0
    first, last = readings[0].sequence, readings[-1].sequence
    return max(0, last - first + 1 - len(readings))


def _missing_frames(readings: Sequence[GloveReading]) -> tuple[str, ...]:
    if len(readings) < LEAST_FRAMES:
        return (f"only {len(readings)} frames came; {LEAST_FRAMES} are needed.",)
    if len({reading.run for reading in readings}) > 1:
        return ("the capture daemon was started again meanwhile.",)
    missing = missing_frames(readings)
    if missing > MOST_MISSING * (missing + len(readings)):
        return (f"{missing} of {missing + len(readings)} frames did not arrive.",)
    silence = float(np.diff([reading.time_s for reading in readings]).max())
    if silence > LONGEST_SILENCE_S:
        return (f"the glove was silent for {silence:.1f} s.",)
    return ()


def _jumps(readings: Sequence[GloveReading], sensors: Sequence[str], ranges: ActiveRanges) -> tuple[str, ...]:
    time_s = np.array([reading.time_s for reading in readings])
    values = np.array([reading.values for reading in readings], float)
    step = 100 * np.abs(np.diff(values, axis=0)) / ranges.span
    allowed = np.maximum(JUMP_PERCENT, FASTEST_PERCENT_S * np.diff(time_s))[:, None]
    beyond = step - allowed
    if beyond.max() <= 0:
        return ()
    frame, sensor = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    at_s = time_s[frame + 1] - time_s[0]
    return (
        f"sensor {sensors[int(sensor)]} jumped by {step[frame, sensor]:.0f} % of its range after {at_s:.1f} s"
        ": a loose wire, or the glove slipped.",
    )


def _not_still(moved: Mapping[str, float]) -> tuple[str, ...]:
    worst = max(moved, key=lambda sensor: moved[sensor])
    if moved[worst] <= STILL_PERCENT:
        return ()
    return (
        f"the hand moved: {worst} by {moved[worst]:.1f} % of its range; {STILL_PERCENT:g} % are allowed.",
    )


def _hardly_moved(step: Step, moved: Mapping[str, float]) -> tuple[str, ...]:
    needed = TOUCHING_PERCENT if step.touches else MOVED_PERCENT
    lazy = [sensor for sensor in step.moves if moved[sensor] < needed]
    thumb = [sensor for sensor in step.moves if sensor.startswith("T")]
    other = [sensor for sensor in moved if sensor.startswith("P_") and moved[sensor] >= 2 * MOVED_PERCENT]
    if thumb and len(lazy) == len(step.moves) and other:
        return (
            f"{other[0]} moved through {moved[other[0]]:.0f} % of its range and the thumb's sensors did not: "
            "is this a glove of the other hand?",
        )
    return tuple(
        f"{sensor} went through {moved[sensor]:.0f} % of its range only; {needed:g} % are needed."
        for sensor in lazy
    )


def _dead(readings: Sequence[GloveReading], sensors: Sequence[str], ranges: ActiveRanges) -> tuple[str, ...]:
    went = np.ptp(np.array([reading.values for reading in readings], float), axis=0)
    least = DEAD_SHARE * ranges.least
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
) -> tuple[str, ...]:
    if not step.touches or flat is None:
        return ()
    mean = np.mean([reading.values for reading in readings], axis=0)
    reasons = []
    for finger in step.touches[1:]:
        own = [place for place, name in enumerate(sensors) if name in (f"{finger}_MCP", f"{finger}_PIP")]
        bent = [100 * abs(mean[place] - flat[sensors[place]]) / ranges.span[place] for place in own]
        if bent and max(bent) < BENT_PERCENT:
            reasons.append(
                f"the finger is {max(bent):.0f} % of its range from flat: it did not touch the thumb."
            )
    return tuple(reasons)


SAME_PERCENT = 8.0
"""Of the active range; with 2.5 degrees from time to time, a hundred degrees repeat within 3.5 %."""


def moved_since_start(state: SamplingState, ranges: ActiveRanges) -> list[str]:
    """A sentence for each sensor that has moved, or one if none has; nothing without two poses twice."""
    changes = _changes(state, ranges)
    if len(changes) < 2:
        return []
    each = np.array(changes)
    alike = (each > 0).all(axis=0) | (each < 0).all(axis=0)
    least = np.where(alike, np.abs(each).min(axis=0), 0.0)
    held = [sensor in usual_angles()["flat"] for sensor in state.sensors]
    moved = [place for place in np.flatnonzero(held).tolist() if least[place] > SAME_PERCENT]
    if not moved:
        return [f"The poses read the same at the end as at the start, within {SAME_PERCENT:g} % of range."]
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
