"""Takes from the marks of a sampling: what was recorded in its steps, with what is known of the angles.

The recording stays as it is; these takes are cut out of it. Steps of one part that follow each other make one
take, and what was recorded in the minute before is its pre-roll. A held or clamped rotation has its angle in
every frame of its step, all else is not measured. Touches get their angles from inverse kinematics: until
then their takes have none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.sampling.protocol import Kind, Step
from glovecal_models.sampling.state import Attempt, SamplingState
from glovecal_models.sampling.steps import CHECK_PART
from glovecal_models.takes.take import Take

PRE_ROLL_S = 60.0
REUSABLE: tuple[Kind, ...] = ("fk_independent", "fk_cross_couple")
"""Kinds that hold for another subject too, roughly: sensors are calibrated, not hands (Wang & Neff 2013,
section 8.2). An IK sample depends on the lengths of one hand."""


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
