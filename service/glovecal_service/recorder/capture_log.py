"""What a glove's capture daemon answers to a recorder: where it stands, and the frames in its logs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import zenoh

from glovecal_client.clock import wall_ns
from glovecal_client.errors import NoAnswer
from glovecal_client.gap_repair import fetch_block
from glovecal_client.keys import GloveKeys
from glovecal_client.queries import ask_json
from glovecal_client.wire.frame import Frame

ANSWER_WITHIN_S = 1.0


@dataclass(frozen=True)
class CaptureRun:
    """One start of the capture daemon."""

    run_id: int
    started_wall_ns: int
    """By the capture computer's clock."""


@dataclass(frozen=True)
class CaptureStanding:
    """Where the capture daemon stands at this moment."""

    runs: tuple[CaptureRun, ...]
    """Runs whose logs it has, oldest first; the last one is going on."""
    sequence: int
    """The last number given in the run that goes on, -1 before the first."""
    disk_full: bool
    """Numbered frames may be waiting in the daemon's memory for room in its log."""
    clock_ahead_ns: int
    """By how much the capture computer's wall clock is ahead of this one's, at most."""
    meta: dict[str, Any] = field(default_factory=dict)
    """What it says of itself and its glove."""


class CaptureLog:
    """The capture daemon of one glove, over zenoh."""

    def __init__(self, session: zenoh.Session, keys: GloveKeys) -> None:
        self._session = session
        self._keys = keys

    def standing(self) -> CaptureStanding:
        """Raises NoAnswer if nobody answers, or not with a status and a meta."""
        meta = ask_json(self._session, self._keys.meta, timeout_s=ANSWER_WITHIN_S)
        asked_ns = wall_ns()
        status = ask_json(self._session, self._keys.status, timeout_s=ANSWER_WITHIN_S)
        try:
            runs = [*meta.get("earlier_runs", ()), status]
            last = status["sequence"]
            return CaptureStanding(
                tuple(CaptureRun(int(run["run_id"], 16), int(run["started_wall_ns"])) for run in runs),
                -1 if last is None else int(last),
                status.get("disk") == "full",
                # a capture of before this field was there is taken to have this computer's clock
                int(status.get("wall_ns", asked_ns)) - asked_ns,
                meta,
            )
        except (KeyError, TypeError, ValueError) as error:
            raise NoAnswer(f"{self._keys.status}: the answer is not a capture daemon's") from error

    def block(self, run_id: int, first: int, last: int) -> list[Frame]:
        """The first of the frames ``first`` to ``last`` that the log has, flagged as repaired; [] if none.

        Raises NoAnswer, QueryRefused if the run's log is not there or cannot be read, WireError.
        """
        return fetch_block(self._session, self._keys, run_id, first, last, timeout_s=ANSWER_WITHIN_S)
