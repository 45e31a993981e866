"""Why a frame was not given to a model, and how that is counted and logged."""

from __future__ import annotations

import logging
import time
from enum import Enum

LOG_EVERY_S = 10.0

_log = logging.getLogger("glovecal.realtime")


class Refusal(Enum):
    """Reasons; the values stand in the status document."""

    DAMAGED = "damaged"
    UNKNOWN_VERSION = "unknown_version"
    NOT_FINITE = "not_finite"
    DUPLICATE = "duplicate"
    SEQUENCE_BACKWARDS = "sequence_backwards"
    SEQUENCE_JUMP = "sequence_jump"
    TIME_BACKWARDS = "time_backwards"
    SECOND_PUBLISHER = "second_publisher"
    SENSOR_COUNT = "sensor_count"
    OUT_OF_RANGE = "out_of_range"
    NOT_PREDICTABLE = "not_predictable"


class Refused(Exception):
    """A frame that must not reach a model."""

    def __init__(self, reason: Refusal, sentence: str) -> None:
        super().__init__(sentence)
        self.reason = reason


class RefusalCount:
    """Refused frames of one glove by reason; logs the first of a reason and then at most one in 10 s."""

    def __init__(self, glove: str) -> None:
        self._glove = glove
        self._counts: dict[Refusal, int] = {}
        self._logged_at: dict[Refusal, float] = {}
        self.last_sentence = ""

    def add(self, refused: Refused) -> None:
        """Count one frame."""
        reason = refused.reason
        self._counts[reason] = self._counts.get(reason, 0) + 1
        now = time.monotonic()
        if now - self._logged_at.get(reason, -LOG_EVERY_S) >= LOG_EVERY_S:
            self._logged_at[reason] = now
            self.last_sentence = str(refused)
            _log.warning(
                "glove %s: frame refused (%s, %d so far): %s",
                self._glove, reason.value, self._counts[reason], refused,
            )  # fmt: skip

    @property
    def total(self) -> int:
        return sum(self._counts.values())

    def by_reason(self) -> dict[str, int]:
        """Counts of the reasons that occurred."""
        return {reason.value: count for reason, count in list(self._counts.items())}
