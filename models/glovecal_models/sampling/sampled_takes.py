"""Takes from the marks of a sampling: what was recorded in its steps, with what is known of the angles.

The recording stays as it is; these takes are cut out of it. Steps of one part that follow each other make one
take, and what was recorded in the minute before is its pre-roll. A held or clamped rotation has its angle in
every frame of its step, all else is not measured. Touches get their angles from inverse kinematics: until
then their takes have none.

How well the first pose or widget of a sampling is read again at its end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.presentation.document import answer
from glovecal_models.sampling.limits import SAMPLING_LIMITS, SamplingLimits
from glovecal_models.sampling.protocol import CHECK_PART, Kind, Step, usual_angles
from glovecal_models.sampling.state import ActiveRanges, Attempt, SamplingState
from glovecal_models.takes.take import Take

PRE_ROLL_S = 60.0
REUSABLE: tuple[Kind, ...] = ("fk_independent", "fk_cross_couple")
"""Kinds that hold for another subject too, roughly: sensors are calibrated, not hands (Wang & Neff 2013,
section 8.2). An IK sample depends on the lengths of one hand."""
ANGLES_APART_DEG = 5.0
"""Angles that lie closer together give no counts per degree."""


@dataclass(frozen=True)
class SampledTake:
    take: Take
    part: str
    kind: Kind
    steps: tuple[Step, ...]
    recording: str
    begins_s: float

    def to_document(self) -> dict[str, Any]:
        """What is kept beside the take: kind and steps, with touches and rod for inverse kinematics."""
        return {
            "part": self.part,
            "kind": self.kind,
            "rough": False,
            "steps": [
                {
                    "name": step.name,
                    "pose": step.pose,
                    "angles": {} if step.repeats else dict(step.angles),
                    "touches": list(step.touches),
                    "rod_mm": step.rod_mm,
                }
                for step in self.steps
            ],
        }


def sampled_takes(state: SamplingState, recorded: Mapping[str, Take], *, name: str) -> list[SampledTake]:
    """The takes in the order of time, named ``name`` and their part; ``recorded`` by name of the recording.

    A step whose frames are not in its recording is left out.
    """
    takes: list[SampledTake] = []
    names: dict[str, int] = {}
    for run in _runs(state):
        whole = recorded.get(run[0][1].recording)
        marks = [] if whole is None else [mark for mark in run if len(_frames(whole, mark[1]))]
        if whole is None or not marks:
            continue
        part = marks[0][0].part
        names[part] = names.get(part, 0) + 1
        number = f"-again-{names[part]}" if names[part] > 1 else ""
        takes.append(_cut(whole, marks, f"{name}-{part}{number}"))
    return takes


def is_labelled(document: Mapping[str, Any]) -> bool:
    """Whether a take with this document belongs to a calibration; the check of a later wearing does not."""
    return document["kind"] != "range" and document["part"] != CHECK_PART


def for_other_subject(take: Take, document: Mapping[str, Any], subject: str) -> tuple[Take, dict[str, Any]]:
    """The take and its document as they may be used for a person other than ``subject``, whose it is.

    Raises BadInput for what depends on the hand.
    """
    kind = document["kind"]
    if kind not in REUSABLE:
        raise BadInput(
            f"take {take.name!r} holds samples of kind {kind}, which depend on {subject}'s hand; only "
            f"{' and '.join(REUSABLE)} can be used for another person"
        )
    changed = replace(take, name=f"{take.name}-of-{subject}", wearing=f"{subject}: {take.wearing}")
    return changed, {**document, "rough": True, "from_subject": subject}


def _runs(state: SamplingState) -> list[list[tuple[Step, Attempt]]]:
    """Marks that count, by time, split where part or recording changes."""
    marks = [
        (state.protocol.step(attempt.step), attempt)
        for attempt in state.finished().values()
        if attempt.outcome == "good" and attempt.begins_s is not None
    ]
    recordings = list(dict.fromkeys(attempt.recording for attempt in state.attempts))
    marks.sort(key=lambda mark: (recordings.index(mark[1].recording), mark[1].begins_s))
    runs: list[list[tuple[Step, Attempt]]] = []
    for step, attempt in marks:
        last = runs[-1][-1] if runs else None
        same = last and last[0].part == step.part and last[1].recording == attempt.recording
        if not same:
            runs.append([])
        runs[-1].append((step, attempt))
    return runs


def _frames(take: Take, attempt: Attempt) -> np.ndarray:
    """Rows of ``take`` from the attempt's begin to its end."""
    inside = (take.time_s >= attempt.begins_s) & (take.time_s <= attempt.ends_s)
    return np.flatnonzero(inside)


def _cut(whole: Take, marks: list[tuple[Step, Attempt]], name: str) -> SampledTake:
    rows = [_frames(whole, attempt) for _, attempt in marks]
    begins_s = float(whole.time_s[rows[0][0]])
    first = int(np.searchsorted(whole.time_s, begins_s - PRE_ROLL_S))
    last = int(rows[-1][-1]) + 1
    taught = [{} if step.repeats else step.angles for step, _ in marks]  # a check teaches nothing
    rotations = tuple(dict.fromkeys(rotation for angles in taught for rotation in angles))
    reference = np.full((last - first, len(rotations)), np.nan)
    poses = [""] * (last - first)
    for (step, _), angles, frames in zip(marks, taught, rows, strict=True):
        for rotation, angle in angles.items():
            reference[frames - first, rotations.index(rotation)] = angle
        for frame in (frames - first).tolist():
            poses[frame] = step.pose
    time_s = whole.time_s[first:last]
    take = replace(
        whole,
        name=name,
        time_s=time_s,
        readings=whole.readings[first:last],
        rotations=rotations,
        reference_time_s=time_s if rotations else np.empty(0),
        reference=reference if rotations else np.empty((0, 0)),
        context={key: column[first:last] for key, column in whole.context.items()},
        poses=tuple(poses) if any(poses) else None,
        begins_s=begins_s,
    )
    steps = tuple(step for step, _ in marks)
    return SampledTake(take, steps[0].part, steps[0].kind, steps, marks[0][1].recording, begins_s)


@answer
class SensorChange:
    sensor: str
    counts: float
    """At the end less at the start."""
    percent: float
    """The same, of the sensor's active range."""
    degrees: float | None
    """By a straight line through the angles of this sampling; None: it has no two for this sensor."""


@answer
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
    usual_deg: float = SAMPLING_LIMITS.repeat_deg
    """How well a person repeats a pose."""

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
