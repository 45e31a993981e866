"""Where a sampling stands: everything that has to outlive a process, as one JSON document.

A protocol may grow: somebody tells, from what was recorded so far, which steps come next.

What the protocol sees of the glove: frames, each sensor's active range, and how still the hand is.

Stillness is in percent of the active range. Means of 0.1 s are compared, so that noise is not taken for
motion. The range is what the sensor has shown so far in this wearing: nobody knows a new subject's before.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.sampling.protocol import Protocol, Step
from glovecal_models.takes import still_hand
from glovecal_models.takes.still_hand import BLOCK_S

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


@dataclass(frozen=True, eq=False, slots=True)
class GloveReading:
    time_s: float
    """The capture computer's monotonic clock, as in the recording."""
    sequence: int
    run: str
    """One start of the capture daemon."""
    values: np.ndarray
    """Raw readings, shape (S,)."""
    button: bool = False


FEW_BLOCKS = 3
NOISE_SPAN = 3.5
"""From lowest to highest of a dozen means that only noise moves, in their standard deviations."""
SD_PER_MEDIAN = 1.4826
"""Of normally distributed numbers: standard deviation over the median of their sizes."""
LEAST_SHARE_OF_COUNTS = 0.1
"""A sensor that has shown less than this share of what the hardware can send is judged by it."""


@dataclass
class ActiveRanges:
    """Lowest and highest block mean of each sensor, shape (S,) each."""

    low: np.ndarray
    high: np.ndarray
    least: float = 0.0
    """In readings."""

    @classmethod
    def unknown(cls, sensors: int, counts: tuple[float, float] | None) -> ActiveRanges:
        least = LEAST_SHARE_OF_COUNTS * (counts[1] - counts[0]) if counts else 0.0
        return cls(np.full(sensors, np.inf), np.full(sensors, -np.inf), least)

    @property
    def span(self) -> np.ndarray:
        """Active range in readings; not smaller than what the hardware makes sensible, never 0."""
        seen = np.where(self.high > self.low, self.high - self.low, 0.0)
        return np.maximum(seen, max(self.least, 1e-9))

    @property
    def middle(self) -> np.ndarray:
        return (self.low + self.high) / 2

    def widen(self, means: np.ndarray) -> None:
        """``means`` (B, S): what the sensors showed now."""
        if len(means):
            self.low = np.minimum(self.low, means.min(axis=0))
            self.high = np.maximum(self.high, means.max(axis=0))

    def to_document(self) -> dict[str, Any]:
        seen = np.isfinite(self.low)
        return {
            "low": np.where(seen, self.low, 0.0).tolist() if seen.all() else None,
            "high": np.where(seen, self.high, 0.0).tolist() if seen.all() else None,
            "least": self.least,
            "sensors": len(self.low),
        }

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> ActiveRanges:
        ranges = cls.unknown(document["sensors"], None)
        ranges.least = document["least"]
        if document["low"] is not None:
            ranges.low, ranges.high = np.array(document["low"]), np.array(document["high"])
        return ranges


def block_means(readings: Sequence[GloveReading]) -> np.ndarray:
    """Means of 0.1 s, shape (B, S)."""
    if not readings:
        return np.empty((0, 0))
    time_s = np.array([reading.time_s for reading in readings])
    values = np.array([reading.values for reading in readings], float)
    return still_hand.block_means(time_s, values)[0]


def moved_percent(readings: Sequence[GloveReading], ranges: ActiveRanges) -> np.ndarray:
    """How far each sensor went, shape (S,), percent of its active range; what its noise does is taken off."""
    means = block_means(readings)
    if not len(means):
        return np.empty(0)
    by_noise = NOISE_SPAN * _noise(readings) / np.sqrt(len(readings) / len(means))
    means = means[:-1] if len(means) > FEW_BLOCKS else means  # the last may be as noisy as a frame
    went = np.ptp(means, axis=0)
    return 100 * np.sqrt(np.maximum(went**2 - by_noise**2, 0.0)) / ranges.span


def _noise(readings: Sequence[GloveReading]) -> np.ndarray:
    """Standard deviation of one frame, shape (S,): second differences leave motion out."""
    if len(readings) < 3:
        return np.zeros(len(readings[0].values))
    bends = np.diff([reading.values for reading in readings], n=2, axis=0)
    return SD_PER_MEDIAN * np.median(np.abs(bends), axis=0) / np.sqrt(6)


KEPT_S = 1.2


class RecentReadings:
    def __init__(self) -> None:
        self._last: deque[GloveReading] = deque()
        self.kept: list[GloveReading] = []
        """Of the running step."""
        self.keeps = False
        self.moved = False
        """Whether the hand moved since ``forget_motion``."""

    @property
    def newest(self) -> GloveReading | None:
        return self._last[-1] if self._last else None

    def add(self, reading: GloveReading) -> bool:
        """Whether it is one: of this many sensors, and later than the one before."""
        last = self.newest
        if last is not None and last.run != reading.run:
            self._last.clear()
        elif last is not None and reading.time_s <= last.time_s:
            return False
        self._last.append(reading)
        while reading.time_s - self._last[0].time_s > KEPT_S:
            self._last.popleft()
        if self.keeps:
            self.kept.append(reading)
        return True

    def begin(self) -> None:
        self.kept, self.keeps = [], True

    def end(self) -> list[GloveReading]:
        kept, self.kept, self.keeps = self.kept, [], False
        return kept

    def forget(self) -> None:
        self._last.clear()
        self.end()

    def percent(self, seconds: float, ranges: ActiveRanges) -> float | None:
        """How far the most moving sensor went in the last ``seconds``; None before there are so many."""
        last = self.newest
        if last is None or last.time_s - self._last[0].time_s < seconds - BLOCK_S:
            return None
        window = [reading for reading in self._last if reading.time_s > last.time_s - seconds]
        return float(moved_percent(window, ranges).max())
