"""Where a sampling stands: everything that has to outlive a process, as one JSON document.

A protocol may grow: somebody tells, from what was recorded so far, which steps come next.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

from glovecal_models.errors import BadInput
from glovecal_models.sampling.protocol import Protocol, Step

Outcome = Literal["good", "bad", "skipped"]


@dataclass
class Attempt:
    """Plain data. Times are the capture computer's clock, as in the recording."""

    step: str
    outcome: Outcome
    reasons: tuple[str, ...] = ()
    """Why it is bad, or was skipped."""
    begins_s: float | None = None
    ends_s: float | None = None
    recording: str = ""
    frames: int = 0
    missing: int = 0
    """Frames that did not arrive; the recording may have fetched them since."""
    moved_percent: float | None = None
    """How far the sensor that moved most went, percent of its active range."""
    means: dict[str, float] = field(default_factory=dict)
    """Mean reading by sensor."""
    response: float | None = None
    """What the sensor of a rotation held by a widget reads while its neighbours are half bent."""
    kept: list[list[float]] = field(default_factory=list)
    """Some of its readings, in the order of the sensors; only where the protocol grows."""
    withdrawn: bool = False
    """Undone."""

    @property
    def counts(self) -> bool:
        """Whether the step is finished by it."""
        return not self.withdrawn and self.outcome != "bad"

    def to_document(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Attempt:
        return cls(**{**document, "reasons": tuple(document["reasons"])})


VERSION = 1
Phase = Literal[
    "choosing",
    "waiting",
    "countdown",
    "settling",
    "recording",
    "judged",
    "lost",
    "paused",
    "done",
    "stopped",
]
RUNNING: tuple[Phase, ...] = ("countdown", "settling", "recording")
OVER: tuple[Phase, ...] = ("done", "stopped")
Trigger = Literal["key", "timer", "still"]
TRIGGERS: tuple[Trigger, ...] = get_args(Trigger)


@dataclass
class SamplingState:
    """``since_s`` is the clock that the protocol is driven by, attempts have the glove's."""

    protocol: Protocol
    sensors: tuple[str, ...]
    trigger: Trigger = "key"
    """What begins a step: ``key`` waits for the user (or the glove's button), ``timer`` gives him three
    seconds, ``still`` begins when the hand is still again after it moved. Steps that need something in the
    hand wait for the user anyway, except with ``timer``."""
    phase: Phase = "waiting"
    since_s: float = 0.0
    step: str = ""
    """The one at hand, "" when all are finished."""
    attempts: list[Attempt] = field(default_factory=list)
    ranges: dict[str, Any] = field(default_factory=dict)
    """Of the sensors, ``ActiveRanges.to_document()``."""
    capture_s: float = 0.0
    """Time spent in countdown, settling and recording so far."""
    said: str = ""
    said_number: int = 0
    """Grows with each sentence, so that each is read out once."""
    expected: dict[str, Any] = field(default_factory=dict)
    """What the chosen step is expected to teach; only where the protocol grows."""
    sentences: list[str] = field(default_factory=list)
    """What the end found."""

    def now(self) -> Step:
        return self.protocol.step(self.step)

    def finished(self) -> dict[str, Attempt]:
        """The attempt that counts, by step: the last good or skipped one that was not undone."""
        return {attempt.step: attempt for attempt in self.attempts if attempt.counts}

    def first_unfinished(self) -> str:
        finished = self.finished()
        return next((step.name for step in self.protocol.steps if step.name not in finished), "")

    def say(self, sentence: str) -> None:
        self.said, self.said_number = sentence, self.said_number + 1

    def to_document(self) -> dict[str, Any]:
        return {
            "version": VERSION,
            "protocol": self.protocol.to_document(),
            "sensors": list(self.sensors),
            "trigger": self.trigger,
            "phase": self.phase,
            "since_s": self.since_s,
            "step": self.step,
            "attempts": [attempt.to_document() for attempt in self.attempts],
            "ranges": self.ranges,
            "capture_s": self.capture_s,
            "expected": self.expected,
            "said": self.said,
            "said_number": self.said_number,
            "sentences": list(self.sentences),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> SamplingState:
        """Raises BadInput for another version."""
        if document.get("version") != VERSION:
            raise BadInput(
                f"sampling document of version {document.get('version')}; this software reads "
                f"{VERSION}; begin a new sampling"
            )
        values = {name: value for name, value in document.items() if name != "version"}
        return cls(
            **{
                **values,
                "protocol": Protocol.from_document(document["protocol"]),
                "sensors": tuple(document["sensors"]),
                "attempts": [Attempt.from_document(item) for item in document["attempts"]],
            }
        )


@dataclass(frozen=True)
class NextSteps:
    steps: tuple[Step, ...]
    are_last: bool
    """The protocol grows no more; with no steps either it is over."""
    sentence: str
    document: dict[str, Any] = field(default_factory=dict)
    """Why, as data."""


Choose = Callable[[SamplingState], NextSteps | None]
"""None: not known yet, ask again. It may be asked often and must not make the frames wait."""
