"""The frames before a recording: what effects with a memory need to know of the time before it.

As many as asked for, but of the same wearing only. They lie in the capture daemon's log and are fetched from
there, newest first, in a thread of their own: the recording's own frames never wait for them.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from queue import Empty, Full, Queue
from typing import Any

import zenoh

from glovecal_client.errors import NoAnswer, WireError
from glovecal_client.gap_repair import fetch_frames
from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame
from glovecal_models.effects.base.dynamics import LONGEST_GAP_S
from glovecal_service.plain import reason_of
from glovecal_service.store.recordings import PRE_ROLL
from glovecal_service.store.records import GloveRecord, RecordingRecord

BLOCK_FRAMES = 512
MOST_FRAMES = 120_000
"""Ten minutes at 200 Hz."""
PAUSE_S = 0.02
"""Between two blocks: capture has its glove to read."""
TRY_AGAIN_AFTER_S = 2.0
ANSWER_WITHIN_S = 2.0


class PreRoll:
    """Fetches what comes before ``oldest`` in its run, back to ``from_ns`` of the run's monotonic clock.

    It ends where the run began, and at a pause after which effects with a memory start anew.
    """

    def __init__(self, session: zenoh.Session, keys: GloveKeys, oldest: Frame, from_ns: int) -> None:
        self._session = session
        self._keys = keys
        self._oldest = oldest
        self._from_ns = from_ns
        self._left = MOST_FRAMES
        self._ended: str | None = None if oldest.sequence else "the run began then"
        """Why nothing comes before, "" where it reaches back far enough; None while it is fetched."""
        self._trouble = ""
        self._fetched: Queue[list[Frame]] = Queue(maxsize=2)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="pre-roll", daemon=True)
        self._thread.start()

    @property
    def why_shorter(self) -> str:
        """A clause on why the pre-roll does not reach back to ``from_ns``; "" when it does."""
        return self._ended if self._ended is not None else self._trouble or "the rest was not fetched"

    @property
    def goes_on(self) -> bool:
        """Whether more can be expected soon: there is some, or capture answers."""
        fetching = self._thread.is_alive()
        return not self._fetched.empty() or (fetching and not self._trouble)

    def take(self) -> list[Frame]:
        """Some of the frames fetched, newest first, flagged as repaired; does not wait."""
        try:
            return self._fetched.get_nowait()
        except Empty:
            return []

    def stop(self, why: str | None = None) -> None:
        """Fetch no more, because of ``why``. The thread ends with the answer to its last question."""
        if why is not None:
            self._ended = why
        self._stop.set()

    def wait(self) -> None:
        """Wait for the thread after ``stop``: from then on the session may be closed."""
        self._thread.join(2 * ANSWER_WITHIN_S)

    def _run(self) -> None:
        while self._ended is None and not self._stop.is_set():
            try:
                block = self._ask()
            except (NoAnswer, WireError, zenoh.ZError) as error:
                self._trouble = f"capture's log did not give more: {reason_of(error)}"
                self._stop.wait(TRY_AGAIN_AFTER_S)
            else:
                self._trouble = ""
                self._hand_over(self._wanted(block))
                self._stop.wait(PAUSE_S)

    def _ask(self) -> list[Frame]:
        before = self._oldest.sequence
        first = max(0, before - min(BLOCK_FRAMES, self._left))
        return fetch_frames(
            self._session, self._keys.site, self._keys.glove, self._oldest.run_id, first, before - 1,
            timeout_s=ANSWER_WITHIN_S,
        )  # fmt: skip

    def _wanted(self, block: list[Frame]) -> list[Frame]:
        """The frames of ``block`` that belong to the pre-roll, newest first."""
        kept = []
        for frame in reversed(block):
            if frame.monotonic_ns < self._from_ns:
                self._ended = ""
                break
            pause_s = (self._oldest.monotonic_ns - frame.monotonic_ns) / 1e9
            if not 0.0 < pause_s <= LONGEST_GAP_S:
                self._ended = f"before that the glove was silent for {pause_s:.1f} s"
                break
            kept.append(frame)
            self._oldest = frame
        self._left -= len(kept)
        if self._ended is None and self._oldest.sequence == 0:
            self._ended = "the run began then"
        elif self._ended is None and self._left <= 0:
            self._ended = f"more than {MOST_FRAMES} frames are not taken"
        return kept

    def _hand_over(self, frames: list[Frame]) -> None:
        while not self._stop.is_set():
            try:
                self._fetched.put(frames, timeout=0.2)
            except Full:
                continue
            return


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
