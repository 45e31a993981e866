"""What the store hands out: plain frozen records, never database rows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Literal

from glovecal_models.calibration.methods import OF_SHAPES
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import HANDS, Handedness, is_of_hand, known_hand
from glovecal_models.hand.skeleton import Palm, Skeleton, hand_skeleton
from glovecal_models.sampling.sampled_takes import is_labelled
from glovecal_models.takes.session_drift import shape_of
from glovecal_models.takes.take import KnownLatency, Stretch
from glovecal_models.takes.time_code import TimeCode

RecordingState = Literal["requested", "recording", "stopping", "repairing", "done", "failed"]
"""``repairing``: it is over and its take can be used, but frames may still come from the capture log."""
JobState = Literal["queued", "running", "done", "failed", "cancelled"]

CLOCK_UNKNOWN = "clock_unknown"
"""Fact of a take: a repair of clocks did not find that of its reference."""
LEFT_OUT = "left_out"
"""Fact of a take: stretches that people left out, in seconds since its first frame, the newest last."""
TIME_CODE = "time_code"
"""Fact of a take: ``glovecal_models.takes.time_code.TimeCode``, as a document."""

FINISHED_JOB_STATES: tuple[JobState, ...] = ("done", "failed", "cancelled")
OPEN_RECORDING_STATES: tuple[RecordingState, ...] = ("requested", "recording", "stopping")


@dataclass(frozen=True)
class SubjectRecord:
    """A person: owns hand dimensions, takes and calibration models."""

    name: str
    title: str
    dimensions: dict[str, float]
    """Hand dimensions in millimetres by name; empty if nobody measured them."""
    created_at: datetime
    hand: str = "unknown"
    """For what does not say its own: ``right``, ``left``, or ``unknown`` until somebody says it."""

    @property
    def known_hand(self) -> Handedness | None:
        return known_hand(self.hand)

    def skeleton(self, hand: Handedness | None = None, palm: Palm = "rigid") -> Skeleton:
        """This person's hand, or the one that is named; sizes and limits are the same for both.

        Drawn as a right one while nobody said which it is. Raises BadInput for dimensions that no hand has.
        """
        shown = hand or self.known_hand or "right"
        return hand_skeleton(HandDimensions.from_measured(self.dimensions), shown, palm)


@dataclass(frozen=True)
class LayoutRecord:
    """A layout in the store, or one that is built in (``built_in``, never stored)."""

    name: str
    document: dict[str, Any]
    """``glovecal_models.layout.Layout.to_document()``."""
    built_in: bool
    created_at: datetime | None = None


@dataclass(frozen=True)
class GloveRecord:
    """A glove that was seen on the network, and who wears it."""

    name: str
    layout: str | None
    subject: str | None
    wearing: str | None
    hand: str
    simulated: bool
    meta: dict[str, Any]
    """The newest meta message of its capture daemon; empty before the first."""
    first_seen_at: datetime
    last_seen_at: datetime
    assigned_at: datetime | None = None
    """When a user last chose the wearer; None if only the capture daemon said who it is."""
    latency: dict[str, Any] | None = None
    """How late the glove was measured to be: ``latency_s``, ``sd_s``, ``taps`` ...; None if nobody did."""
    delay_ms: int = 0
    """How long its live poses wait for the frames after them, as a user chose."""

    @property
    def known_latency(self) -> KnownLatency | None:
        if self.latency is None:
            return None
        return KnownLatency(float(self.latency["latency_s"]), float(self.latency["sd_s"]))


@dataclass(frozen=True)
class TakeRecord:
    """A stored take: its arrays are in the artifact, its description here."""

    id: str
    name: str
    subject: str
    layout: str
    wearing: str
    source: str
    """``import``, ``recording`` ... : where the frames came from."""
    artifact: str
    """sha256 of the safetensors file that holds the arrays."""
    original_sha256: str | None
    """sha256 of the file the user gave, None for a recording."""
    sensors: tuple[str, ...]
    rotations: tuple[str, ...]
    """Rotations with a reference; empty if nothing was measured."""
    context: tuple[str, ...]
    frames: int
    reference_rows: int
    duration_s: float
    simulated: bool
    recording: str | None
    accounting: dict[str, Any] | None
    facts: dict[str, Any] = field(default_factory=dict)
    """``history``: artifacts of earlier references, newest last."""
    created_at: datetime | None = None

    @property
    def has_reference(self) -> bool:
        return self.reference_rows > 0 and bool(self.rotations)

    @property
    def known_hand(self) -> Handedness | None:
        """Of the glove, as its capture said; None where it did not, and for imported files."""
        return known_hand((self.accounting or {}).get("hand"))

    def is_of(self, hand: Handedness | None) -> bool:
        """Whether it may be a take of that hand: where nobody said which hand it is of, of both."""
        return is_of_hand(self.known_hand, hand)

    @property
    def state(self) -> Literal["complete", "repairing"]:
        """``repairing``: frames of its recording may still be fetched from the capture log."""
        return "complete" if (self.accounting or {}).get("complete", True) else "repairing"

    @property
    def incomplete_sentence(self) -> str:
        """What whoever works with the take has to know; "" for a complete one."""
        if self.state == "complete":
            return ""
        frames = (self.accounting or {}).get("pending_frames", 0)
        pending = f"{frames} frames, and any after its last one," if frames else "frames after its last one"
        return (
            f"Take {self.name} is incomplete: {pending} may still come from the capture log. What is there "
            "is used; train again once the take is complete."
        )

    @property
    def unaligned_sentence(self) -> str:
        """That its reference was not repaired although others were; "" where there is nothing to say."""
        if not self.facts.get(CLOCK_UNKNOWN):
            return ""
        return (
            f"Take {self.name}: the clock of its reference was not found and not repaired, unlike others'; it"
            " is used as it is. Leave it out, or measure again."
        )

    @property
    def note(self) -> str:
        """What people want to remember of it."""
        return str(self.facts.get(NOTE, ""))

    @property
    def time_code(self) -> TimeCode | None:
        """Which SMPTE time code it has at which time; None where none is known."""
        known = self.facts.get(TIME_CODE)
        return None if known is None else TimeCode.of_document(known)

    @property
    def left_out(self) -> tuple[Stretch, ...]:
        """Stretches that people left out, in seconds since its first frame, the newest last."""
        return tuple((low, high) for low, high in self.facts.get(LEFT_OUT, ()))

    @property
    def sampling(self) -> dict[str, Any] | None:
        """What a guided sampling asked for in this take; None when it is of none."""
        return (self.accounting or {}).get("sampling")

    @property
    def teaches(self) -> bool:
        """Whether a calibration can learn from it: from angles, or as a part of a whole guided sampling (a
        check of a later wearing is none)."""
        return self.has_reference or (self.sampling is not None and is_labelled(self.sampling))

    @property
    def hand_shape(self) -> str | None:
        """That of a session (``glovecal shapes``) which is held in it, where nothing else is known."""
        return None if self.has_reference or self.sampling is not None else shape_of(self.name)

    def teaches_by(self, method: str) -> bool:
        """Whether a calibration of ``method`` can learn from it; those of hand shapes do from their names."""
        return self.teaches or (method in OF_SHAPES and self.hand_shape is not None)


def hand_of(takes: Iterable[TakeRecord]) -> Handedness | None:
    """The one hand that takes are known to be of; None where nobody said it, or where they are of both."""
    known = {take.known_hand for take in takes}
    hands: list[Handedness] = [hand for hand in HANDS if hand in known]
    return hands[0] if len(hands) == 1 else None


def incomplete_sentences(takes: Iterable[TakeRecord]) -> list[str]:
    """What is to be known of takes that are incomplete, or whose reference stayed unrepaired."""
    each = [sentence for take in takes for sentence in (take.incomplete_sentence, take.unaligned_sentence)]
    return [sentence for sentence in each if sentence]


REMOVED, NAME, NOTE = "removed_at", "name", "note"
"""Facts that people give a model; a take's note too."""


@dataclass(frozen=True)
class ModelRecord:
    """A calibration model: immutable; ``id`` is the sha256 of its artifact."""

    id: str
    subject: str
    layout: str
    method: str
    parent: str | None
    facts: dict[str, Any]
    """``takes`` (ids), errors, seconds ...: whatever the trainer had to say."""
    created_at: datetime
    hand: Handedness | None = None
    """That of its takes; None where nobody said it, and it reads both hands' gloves."""

    @property
    def is_removed(self) -> bool:
        return bool(self.facts.get(REMOVED))


@dataclass(frozen=True)
class Activation:
    """From ``created_at`` on, frames of ``subject`` with ``layout`` are predicted by ``model``."""

    id: int
    subject: str
    layout: str
    model: str
    kind: Literal["activate", "rollback"]
    previous: int | None
    """The activation that a rollback would return to, None if there is none."""
    created_at: datetime
    hand: Handedness | None = None
    """The model's."""


@dataclass(frozen=True)
class RecordingRecord:
    """A recording somebody asked for; the real-time process carries it out."""

    id: str
    glove: str
    name: str
    subject: str | None
    wearing: str | None
    state: RecordingState
    facts: dict[str, Any]
    """``first_sequence``, ``last_sequence``, ``sent``, ``recorded``, ``repaired``, ``missing``, ``pending``,
    ``pre_roll``, ``take``"""
    requested_at: datetime
    updated_at: datetime

    @property
    def is_open(self) -> bool:
        return self.state in OPEN_RECORDING_STATES

    @property
    def ended_at(self) -> datetime:
        """When its end was asked for; else, and while it goes on, when it last reported."""
        asked_s = self.facts.get("stop_asked_s")
        return self.updated_at if asked_s is None else datetime.fromtimestamp(asked_s, UTC)


@dataclass(frozen=True)
class SamplingRecord:
    """A guided sampling; the recorder process lets it go on."""

    id: str
    glove: str
    subject: str
    wearing: str
    layout: str
    open: bool
    """Until its takes are stored."""
    version: int
    """Grows with each change of ``document``; who changes it says which version he saw."""
    document: dict[str, Any]
    """``glovecal_models.sampling.state.SamplingState``."""
    recordings: list[str]
    takes: list[str]
    live: dict[str, Any]
    """``steadiness_percent``, ``frames_come``: as of now, never needed again."""
    problem: str
    created_at: datetime
    updated_at: datetime


@dataclass(frozen=True)
class JobRecord:
    """Long work: a database row is its only memory."""

    id: str
    kind: str
    subject: str | None
    payload: dict[str, Any]
    state: JobState
    attempt: int
    """How often the job was claimed; writes of an older attempt are refused."""
    owner: str | None
    cancel_requested: bool
    fraction: float
    sentence: str
    detail: dict[str, Any]
    result: dict[str, Any] | None
    error: str | None
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    updated_at: datetime
    traceback: str | None = None
    """Of a job that failed by an error that nobody foresaw; its last part where it is long."""

    @property
    def is_finished(self) -> bool:
        return self.state in FINISHED_JOB_STATES


@dataclass(frozen=True)
class JobEvent:
    """One step of a job's progress, kept for whoever listens later."""

    id: int
    """Grows within the store; ask for events after the last one seen."""
    job: str
    attempt: int
    state: JobState
    fraction: float
    sentence: str
    detail: dict[str, Any]
    created_at: datetime
