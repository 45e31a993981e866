"""What became of one try of a step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

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
