"""One glove on its way through the service: frames that wait, the gate, the counts, the last pose."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from glovecal_client.keys import GloveKeys
from glovecal_client.wire.frame import Frame
from glovecal_service.incoming.frame_gate import FrameGate, Standing
from glovecal_service.incoming.refusal import RefusalCount, Refused
from glovecal_service.realtime.frame_record import FrameRecord
from glovecal_service.realtime.lane_effects import LaneEffects
from glovecal_service.realtime.live_watch import LiveWatch
from glovecal_service.realtime.served_model import ServedModel

WAITING_LIMIT = 64


class Waiting(NamedTuple):
    """A message not yet looked into."""

    message: bytes
    received_ns: int


class GloveLane:
    """Belongs to the predicting thread; others read its counts only.

    Every message received ends as exactly one of predicted, skipped or refused, or is still waiting.
    """

    def __init__(self, keys: GloveKeys) -> None:
        self.keys = keys
        self.glove = keys.glove
        self.gate = FrameGate()
        self.refusals = RefusalCount(keys.glove)
        self.received = 0
        self.predicted = 0
        self.skipped = 0
        self.skipped_in_run = 0
        self._skipped_unseen = 0
        """Skipped since the last frame that passed: perhaps the first frames of a run still unknown."""
        self.valid_ns = 0
        """When its newest valid frame arrived, 0 before the first."""
        self.last_pose: bytes | None = None
        self.last_pose_received_ns = 0
        self.stale_published_ns = 0
        self.model_id: str | None = None
        self.effects: LaneEffects | None = None
        """State of its model's effects; None for a model without."""
        self.watch: LiveWatch | None = None
        """Its last seconds; None before the first pose."""
        self.record: FrameRecord | None = None
        """Put here by who wants the next frame's prediction written down; taken away with it."""
        self._waiting: deque[Waiting] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, message: bytes, received_ns: int) -> None:
        """Let a message wait; the oldest goes when too many do."""
        self.received += 1
        if len(self._waiting) >= WAITING_LIMIT:
            self._waiting.popleft()
            self.gate.note_unread(1)
            self.skip(1)
        self._waiting.append(Waiting(message, received_ns))

    def skip(self, count: int) -> None:
        self.skipped += count
        self.skipped_in_run += count
        self._skipped_unseen += count

    def newest(self, limit: int, oldest_ns: int) -> list[Waiting]:
        """Take the newest ``limit`` messages received since ``oldest_ns``, in order; skip all others."""
        late = 0
        while self._waiting and (len(self._waiting) > limit or self._waiting[0].received_ns < oldest_ns):
            self._waiting.popleft()
            late += 1
        if late:
            self.gate.note_unread(late)
            self.skip(late)
        taken = list(self._waiting)
        self._waiting.clear()
        return taken

    def open(self, waiting: Waiting) -> Frame | None:
        """The frame of a message, or None when it was refused, which is counted."""
        runs = self.gate.runs
        try:
            frame = self.gate.pass_frame(waiting.message, waiting.received_ns)
        except Refused as refused:
            self.refusals.add(refused)
            return None
        self.valid_ns = waiting.received_ns
        if self.gate.runs != runs:
            # a run's frames before its first that passed are as many as its sequence number says, at most
            self.skipped_in_run = min(self._skipped_unseen, frame.sequence)
        self._skipped_unseen = 0
        return frame

    def note_pose(self, message: bytes, received_ns: int, model_id: str | None) -> None:
        """A frame received then became this pose."""
        self.predicted += 1
        self.model_id = model_id
        self.last_pose, self.last_pose_received_ns = message, received_ns

    def effects_of(self, model: ServedModel) -> LaneEffects:
        """The state of the effects of ``model``, a fresh one if the glove had another model before."""
        if self.effects is None or self.effects.model is not model:
            self.effects = LaneEffects(model)
        return self.effects

    def watch_of(self, frame: Frame, model: ServedModel | None, names: tuple[str, ...]) -> LiveWatch:
        """What watches the run of ``frame`` with ``model``; ``names`` of its sensors, where known."""
        watch, count = self.watch, len(frame.readings)
        if watch is None or not watch.is_of(frame.run_id, model, count):
            if len(names) != count:
                names = tuple(f"sensor {number}" for number in range(1, count + 1))
            watch = self.watch = LiveWatch(frame.run_id, model, names)
        return watch

    def status(self, unheard: Callable[[str, Standing | None, int], int]) -> dict[str, Any]:
        """Counts for the status document, all of one moment. ``unheard``: as of ``CaptureReports``.

        ``sent`` = ``received`` + ``missing``, and
        ``received`` = ``predicted`` + ``skipped`` + all ``refused`` + ``waiting``.
        """
        run_id, effects = self.gate.run_id, self.effects
        standing = self.gate.standing
        missing = max(0, (standing.missing if standing else 0) + unheard(self.glove, standing, self.received))
        # what became of a message is counted after its receipt: so this is read before ``received``
        refused, predicted, skipped = self.refusals.by_reason(), self.predicted, self.skipped
        received = self.received
        return {
            "sent": received + missing,
            "received": received,
            "missing": missing,
            "predicted": predicted,
            "skipped": skipped,
            "refused": refused,
            "waiting": received - predicted - skipped - sum(refused.values()),
            "last_refusal": self.refusals.last_sentence,
            "run_id": None if run_id is None else f"{run_id:016x}",
            "runs": self.gate.runs,
            "jumps": self.gate.jumps,
            "sequence": self.gate.sequence,
            "model": self.model_id,
            "effects": None if effects is None else effects.status(),
            "warnings": [] if self.watch is None else self.watch.warnings(),
        }
