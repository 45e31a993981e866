"""A sampling as a page or a terminal shows it."""

from __future__ import annotations

import time
from dataclasses import asdict
from datetime import datetime
from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.sampling.engine import SHOWN_S, TIMER_S
from glovecal_models.sampling.limits import SAMPLING_LIMITS
from glovecal_models.sampling.protocol import COUNTDOWN_S, SETTLE_S, Kind, Motion
from glovecal_models.sampling.repeatability import repeatability
from glovecal_models.sampling.shown_hands import shown_hands
from glovecal_models.sampling.state import Phase, SamplingState, Trigger
from glovecal_service.store.records import SamplingRecord


class StepNow(BaseModel):
    name: str
    kind: Kind
    motion: Motion
    ask: str = Field(description="What the person is asked to do.")
    needs: str = Field(description="What to take in the hand first.")
    place: int = Field(description="1 for the first.")
    seconds: float = Field(description="How long it is recorded.")
    pose: str
    angles: dict[str, float] = Field(description="Degrees by rotation that are known.")
    moves: list[str] = Field(description="Sensors that have to move.")
    touches: list[str]
    rod_mm: float | None
    repeats: str = Field(description="Step that this one does again, as a check; empty for none.")


class StepDone(BaseModel):
    name: str
    kind: Kind
    outcome: str = Field(description="`good`, `bad`, `skipped`, or `` when it was not done yet.")
    reasons: list[str] = Field(description="Why it is bad, or was left out.")


class SensorChangeView(BaseModel):
    sensor: str
    counts: float = Field(description="At the end less at the start.")
    percent: float = Field(description="The same, of the sensor's active range.")
    degrees: float | None = Field(description="By this sampling's known angles; None: too few.")


class RepeatabilityView(BaseModel):
    step: str
    apart_s: float = Field(description="Between the two visits.")
    sensors: list[SensorChangeView]
    rms_deg: float | None
    rms_percent: float
    usual_deg: float = Field(SAMPLING_LIMITS.repeat_deg, description="How well a person repeats a pose.")
    is_much: bool = Field(description="More than a person's own repetition explains.")


class SamplingView(BaseModel):
    id: str
    glove: str
    subject: str
    wearing: str
    layout: str
    protocol: str
    trigger: Trigger
    seed: int | None = Field(description="Of the random order of poses and widgets; None: a fixed order.")
    phase: Phase
    phase_s: float = Field(description="Seconds in this phase until now.")
    phase_of_s: float | None = Field(description="Seconds that it takes; None: until something happens.")
    step: StepNow | None
    steps: list[StepDone]
    say: str = Field(description="To be read out, once for each `say_number`.")
    say_number: int
    steadiness_percent: float | None = Field(
        description="How far the hand moved in the last half second, percent of a sensor's active range."
    )
    still_percent: float = Field(SAMPLING_LIMITS.still_percent, description="What is still.")
    capture_s: float = Field(description="Spent in countdowns, settling and recording so far.")
    capture_of_s: float = Field(description="What the whole takes of somebody who does every step at once.")
    expected: dict[str, Any] = Field(
        description="Protocol `active`: what the chosen step is expected to teach, and its rivals."
    )
    sentences: list[str] = Field(description="What the end found.")
    repeatability: RepeatabilityView | None = Field(
        description="The first pose or widget against itself at the end; None until it was done twice."
    )
    problem: str
    open: bool = Field(description="Until its takes are stored.")
    recordings: list[str]
    takes: list[str]
    created_at: datetime
    updated_at: datetime


def sampling_view(record: SamplingRecord) -> SamplingView:
    state = SamplingState.from_document(record.document)
    return SamplingView(
        id=record.id,
        glove=record.glove,
        subject=record.subject,
        wearing=record.wearing,
        layout=record.layout,
        protocol=state.protocol.name,
        trigger=state.trigger,
        seed=state.protocol.seed,
        phase=state.phase,
        phase_s=round(max(0.0, time.time() - state.since_s), 2),
        phase_of_s=_length(state),
        step=_now(state),
        steps=_steps(state),
        say=state.said,
        say_number=state.said_number,
        steadiness_percent=record.live.get("steadiness_percent"),
        still_percent=SAMPLING_LIMITS.still_percent,
        capture_s=round(state.capture_s, 2),
        capture_of_s=round(state.protocol.capture_s, 2),
        expected=state.expected,
        sentences=state.sentences,
        repeatability=_repeatability(state),
        problem=record.problem,
        open=record.open,
        recordings=record.recordings,
        takes=record.takes,
        created_at=record.created_at,
        updated_at=record.updated_at,
    )


class TargetView(BaseModel):
    step: str = Field(description="Its name, empty when no step is at hand.")
    hands: list[dict[str, float]] = Field(
        description="Degrees by rotation, for viewers: one hand of a pose that is held, two between which a "
        "motion goes to and fro. Only the step's own `angles` are exact; the rest is a usual hand's, and "
        "what is not named (the wrist, last joints) is free."
    )


def target_view(record: SamplingRecord, skeleton: Skeleton) -> TargetView:
    """What the step at hand looks like on the hand of ``skeleton``."""
    state = SamplingState.from_document(record.document)
    return TargetView(step=state.step, hands=shown_hands(state.now(), skeleton) if state.step else [])


def _repeatability(state: SamplingState) -> RepeatabilityView | None:
    found = repeatability(state)
    return None if found is None else RepeatabilityView.model_validate(asdict(found))


def _length(state: SamplingState) -> float | None:
    if not state.step:
        return None
    lengths = {"countdown": COUNTDOWN_S, "settling": SETTLE_S, "recording": state.now().seconds}
    if state.trigger == "timer":
        lengths["waiting"] = TIMER_S
    if state.phase == "judged":
        return _shown_s(state)
    return lengths.get(state.phase)


def _shown_s(state: SamplingState) -> float | None:
    if state.attempts[-1].counts:
        return SHOWN_S
    return None if state.trigger == "key" else TIMER_S


def _now(state: SamplingState) -> StepNow | None:
    if not state.step:
        return None
    document: dict[str, Any] = state.now().to_document()
    names = [step.name for step in state.protocol.steps]
    return StepNow(**document, place=names.index(state.step) + 1)


def _steps(state: SamplingState) -> list[StepDone]:
    told = {attempt.step: attempt for attempt in state.attempts if not attempt.withdrawn} | state.finished()
    return [
        StepDone(
            name=step.name,
            kind=step.kind,
            outcome=told[step.name].outcome if step.name in told else "",
            reasons=list(told[step.name].reasons) if step.name in told else [],
        )
        for step in state.protocol.steps
    ]
