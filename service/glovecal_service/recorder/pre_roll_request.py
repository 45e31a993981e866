"""How much of a pre-roll a recording is to have: as asked for, but of the same wearing only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any

from glovecal_service.store.recordings import PRE_ROLL
from glovecal_service.store.records import GloveRecord, RecordingRecord


@dataclass(frozen=True)
class PreRollRequest:
    asked_s: float = 0.0
    most_s: float = 0.0
    """As much of it as is known to belong to the same wearing."""
    why_less: str = ""
    """Why ``most_s`` is less than ``asked_s``, a clause."""

    @classmethod
    def of_document(cls, document: Mapping[str, Any] | None) -> PreRollRequest:
        """Inverse of ``document``; None is a wish for nothing."""
        return cls(**document) if document else cls()

    def document(self) -> dict[str, Any]:
        return asdict(self)

    def account(self, frames: int, seconds: float, why_shorter: str) -> dict[str, Any]:
        """What the recording's facts tell of its pre-roll; ``why_shorter``: than ``most_s``."""
        why = why_shorter or self.why_less
        sentence = f"{seconds:.1f} of the {self.asked_s:g} s before it ({frames} frames)"
        sentence = f"{sentence}: {why}" if why else sentence
        return {
            "asked_s": self.asked_s,
            "frames": frames,
            "seconds": seconds,
            "sentence": sentence if self.asked_s else "none was asked for",
        }


def pre_roll_request(
    record: RecordingRecord, glove: GloveRecord, others: list[RecordingRecord], now: datetime
) -> PreRollRequest:
    """The wish of ``record``, which begins ``now``; ``others`` are the glove's recordings, newest first.

    A wearing reaches back to the moment somebody last said who wears the glove, and never into a recording of
    another wearing. Ages are of this computer's clock alone: that of the capture computer may be wrong.
    """
    asked_s = float(record.facts.get(PRE_ROLL, {}).get("asked_s", 0.0))
    if record.subject is None:
        return PreRollRequest(asked_s, 0.0, "nobody was said to wear the glove")
    since = worn_since(record, glove, others)
    if since is None or (now - since).total_seconds() >= asked_s:
        return PreRollRequest(asked_s, asked_s)
    most_s = max(0.0, (now - since).total_seconds())
    return PreRollRequest(asked_s, most_s, "who wears the glove was said only then")


def worn_since(record: RecordingRecord, glove: GloveRecord, others: list[RecordingRecord]) -> datetime | None:
    """Since when the glove is known to be worn as ``record`` says; None: for the whole of its run."""
    as_the_glove = _worn(record) == (glove.subject, glove.wearing)
    since = glove.assigned_at if as_the_glove else record.requested_at
    for other in others:
        if other.id == record.id or other.requested_at > record.requested_at:
            continue
        if _worn(other) != _worn(record):
            return max(other.ended_at, since or other.ended_at)
        if not as_the_glove:
            since = other.requested_at
    return since


def _worn(record: RecordingRecord) -> tuple[str | None, str | None]:
    return record.subject, record.wearing
