"""The same poses at start and end: a sensor that reads otherwise has moved on the hand, or drifted.

A person does not take a pose again exactly, so a sensor is named only when every pose says the same of it,
and only where the pose itself holds the joint: the fingers' flexion in flat and fist.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.sampling.key_poses import usual_angles
from glovecal_models.sampling.state import SamplingState
from glovecal_models.sampling.steadiness import ActiveRanges

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
