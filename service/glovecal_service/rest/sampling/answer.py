"""Guided samplings, and what to record next, as REST gives them."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import Field

from glovecal_models.sampling.limits import SAMPLING_LIMITS
from glovecal_models.sampling.protocol import Kind, Motion
from glovecal_models.sampling.sampled_takes import Repeatability
from glovecal_models.sampling.state import Phase, Trigger
from glovecal_service.plain import Row


class StepNow(Row):
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


class StepDone(Row):
    name: str
    kind: Kind
    outcome: str = Field(description="`good`, `bad`, `skipped`, or `` when it was not done yet.")
    reasons: list[str] = Field(description="Why it is bad, or was left out.")


class SamplingView(Row):
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
    repeatability: Repeatability | None = Field(
        description="The first pose or widget against itself at the end; None until it was done twice."
    )
    problem: str
    open: bool = Field(description="Until its takes are stored.")
    recordings: list[str]
    takes: list[str]
    method: str = Field(description="Of the calibration that learns from its takes.")
    created_at: datetime
    updated_at: datetime


class TargetView(Row):
    step: str = Field(description="Its name, empty when no step is at hand.")
    hands: list[dict[str, float]] = Field(
        description="Degrees by rotation, for viewers: one hand of a pose that is held, two between which a "
        "motion goes to and fro. Only the step's own `angles` are exact; the rest is a usual hand's, and "
        "what is not named (the wrist, last joints) is free."
    )


class Reused(Row):
    takes: list[str] = Field(description="New takes, marked as rough.")
    left_out: list[str] = Field(description="Why others cannot be used, in sentences.")


class ProposedStepView(Row):
    name: str
    ask: str = Field(description="What the person is asked to do.")
    needs: str
    seconds: float = Field(description="Capture time, with countdown and settling.")
    angles: dict[str, float] = Field(description="Degrees by rotation that are then known.")
    sd_deg: dict[str, float] = Field(description="Standard deviation now, of the rotations it teaches.")
    sd_after_deg: dict[str, float]
    rms_sd_after_deg: float = Field(description="Over all rotations.")
    error_fall_deg: float = Field(description="Of the expected error of a frame, noise included.")
    sentence: str


class DiagnosedTakeView(Row):
    what: str
    seconds: float
    separates: list[str]
    reason: str


class NextStepsView(Row):
    model: str
    rms_sd_deg: float = Field(description="Root mean variance over everyday readings and rotations, now.")
    sd_deg: dict[str, float]
    noise_deg: dict[str, float] = Field(description="Of a single frame.")
    enough: bool = Field(description="No step is worth its time any more.")
    steps: list[ProposedStepView] = Field(description="The one that teaches most for its time first.")
    diagnosed: DiagnosedTakeView | None = Field(
        description="What the newest diagnosis of the model asks for."
    )
    assumed: list[str] = Field(description="Rotations whose hyperparameters are assumed, not learned.")
    sentences: list[str]
