"""What is to be thought of a recorded step: its frames by themselves, then beside the other steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from glovecal_models.sampling.attempt import Attempt
from glovecal_models.sampling.growing import kept_readings
from glovecal_models.sampling.quality import faults, missing_frames
from glovecal_models.sampling.reading import GloveReading
from glovecal_models.sampling.state import SamplingState
from glovecal_models.sampling.steadiness import ActiveRanges, block_means
from glovecal_models.sampling.step import Step
from glovecal_models.sampling.widget_check import inconsistent_widgets, response


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
    attempt.reasons = faults(step, readings, state.sensors, ranges, _flat(state))
    if readings:
        percent = 100 * np.ptp([reading.values for reading in readings], axis=0) / ranges.span
        attempt.moved_percent = float(percent.max())
    if state.protocol.grows:
        attempt.kept = kept_readings(step, readings)
    if not attempt.reasons:
        _widen(ranges, readings)
        attempt.reasons = _contradictions(state, readings, ranges, attempt, touch_check)
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
) -> tuple[str, ...]:
    """What only the other steps, or inverse kinematics, can tell."""
    step, sentence = state.now(), None
    if step.kind == "fk_cross_couple":
        attempt.response = response(step, readings, state.sensors, ranges)
        (rotation,) = step.angles
        sentence = inconsistent_widgets(rotation, _responses(state, rotation, attempt))
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
