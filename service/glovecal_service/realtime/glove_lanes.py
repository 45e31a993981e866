"""The gloves that are served: so many at most, and those that send no valid frames make room for others.

Each has its frames that wait, the gate, the counts and the last pose. Its last seconds are looked at once a
second for a wrong wearer, a wrong glove or a dead sensor: the predicting thread only copies a row 25 times a
second; who asks for the status does the rest.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from glovecal_client.errors import BadName, WireError
from glovecal_client.keys import GloveKeys, parse_glove_key
from glovecal_client.wire.frame import RUN_ID_BYTES, Frame, decode_frame
from glovecal_models.diagnosis.worn_glove import GloveFinding, live_findings
from glovecal_service.incoming.frame_gate import FrameGate, Refusal, RefusalCount, Refused, Standing
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.incoming.rate_limit import MOST_HZ, RateLimit
from glovecal_service.realtime.delayed_poses import DelayedPoses
from glovecal_service.realtime.frame_record import FrameRecord
from glovecal_service.realtime.lane_effects import LaneEffects
from glovecal_service.realtime.served_model import ServedModel

WAITING_LIMIT = 64
_TOO_MANY = Refused(Refusal.TOO_MANY, "more messages than a glove sends; another publisher uses its name")


class Waiting(NamedTuple):
    """A message not yet looked into."""

    message: bytes
    received_ns: int


class GlovePipeline:
    """Belongs to the predicting thread; others read its counts only.

    Every message received ends as exactly one of predicted, skipped or refused, or is still waiting.
    """

    def __init__(self, keys: GloveKeys) -> None:
        self.keys = keys
        self.glove = keys.glove
        self.term = 0
        """Since this process has the glove."""
        self.is_taken_over = False
        """From another process, and nobody has looked yet which model it is to have here."""
        self.first_received_ns = 0
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
        self.delayed: DelayedPoses | None = None
        """Poses that wait, and how they are estimated; None for a glove without a delay."""
        self.watch: LiveWatch | None = None
        """Its last seconds; None before the first pose."""
        self.record: FrameRecord | None = None
        """Put here by who wants the next frame's prediction written down; taken away with it."""
        self._waiting: deque[Waiting] = deque()
        self._run = b""
        """The run's id as its messages have it."""
        self._own_rate, self._other_rate = RateLimit(), RateLimit()

    def __len__(self) -> int:
        return len(self._waiting)

    def declare_rate(self, rate_hz: Any) -> None:
        """What its capture says of its rate, frames a second; anything may stand there. From any thread."""
        known = float(rate_hz) if isinstance(rate_hz, int | float) and 0 < rate_hz < MOST_HZ else None
        self._own_rate.declare(known)
        self._other_rate.declare(known)

    def add(self, message: bytes, received_ns: int) -> bool:
        """Let a message wait; the oldest goes when too many do. False if it is thrown away at once: no glove
        sends so many. What others send under its name does not cost the run its frames."""
        self.received += 1
        is_own = message[RUN_ID_BYTES] == self._run
        if not (self._own_rate if is_own else self._other_rate).allows(received_ns):
            (self.gate.note_unread if is_own else self.gate.note_strange)(1)
            self.refusals.add(_TOO_MANY)
            return False
        if len(self._waiting) >= WAITING_LIMIT:
            self._waiting.popleft()
            self.gate.note_unread(1)
            self.skip(1)
        self._waiting.append(Waiting(message, received_ns))
        return True

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
            self._run = waiting.message[RUN_ID_BYTES]
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
            "term": self.term,
            "sequence": self.gate.sequence,
            "model": self.model_id,
            "effects": None if effects is None else effects.status(),
            "warnings": [] if self.watch is None else self.watch.warnings(),
        }


WINDOW_S = 8.0
"""With looks a second apart a fault is told within 10 s of motion."""
STEP_NS = 40_000_000
FEWEST_ROWS = 40
LOOK_AGAIN_S = 0.9
CLEAR_LOOKS = 10
"""So many looks at a moving hand find nothing before a warning goes: one that comes to rest shows less."""
_WINDOW_NS = round(WINDOW_S * 1e9)
_ROWS = _WINDOW_NS // STEP_NS + 2


class LiveWatch:
    """Of one run of a glove with one model, or without any. ``add`` belongs to the predicting thread."""

    def __init__(self, run_id: int, model: ServedModel | None, sensors: tuple[str, ...]) -> None:
        self.run_id, self.model, self.sensors = run_id, model, sensors
        rotations = () if model is None else model.rotations
        self._times_ns = np.zeros(_ROWS, np.int64)
        self._readings = np.zeros((_ROWS, len(sensors)))
        self._degrees = np.zeros((_ROWS, len(rotations)))
        self._rows = 0
        self._began_ns: int | None = None
        self._next_ns = 0
        self._fit = None if model is None else model.wearer_fit
        self._found: tuple[GloveFinding, ...] = ()
        self._clear = 0
        self._looked_s = 0.0
        self._looked_rows = 0
        self._lock = Lock()

    def is_of(self, run_id: int, model: ServedModel | None, count: int) -> bool:
        """Whether it watches this run with this model, of so many sensors."""
        return run_id == self.run_id and model is self.model and count == len(self.sensors)

    def add(self, monotonic_ns: int, readings: np.ndarray, degrees: np.ndarray | None) -> None:
        """One frame: readings (S,), angles (R,) or None without a model."""
        if monotonic_ns < self._next_ns:
            return
        self._next_ns = max(self._next_ns + STEP_NS, monotonic_ns - STEP_NS)
        if self._began_ns is None:
            self._began_ns = monotonic_ns
        row = self._rows % _ROWS
        self._times_ns[row] = monotonic_ns
        self._readings[row] = readings
        if degrees is not None:
            self._degrees[row] = degrees
        self._rows += 1

    def warnings(self) -> list[dict[str, Any]]:
        """What is wrong, as JSON. While the hand rests, what was found last stays. From any thread."""
        with self._lock:
            now = time.monotonic()
            if now - self._looked_s >= LOOK_AGAIN_S and self._rows != self._looked_rows:
                self._looked_s, self._looked_rows = now, self._rows
                self._look()
            return [asdict(one) for one in self._found]

    def _look(self) -> None:
        times_ns = self._times_ns.copy()
        newest_ns = int(times_ns.max())
        if self._began_ns is None or newest_ns - self._began_ns < _WINDOW_NS:
            return
        rows = times_ns > newest_ns - _WINDOW_NS
        if rows.sum() >= FEWEST_ROWS:
            found = live_findings(self._readings[rows], self.sensors, self._fit, self._degrees[rows])
            if found is None:
                return
            self._clear = 0 if found else self._clear + 1
            if found or self._clear >= CLEAR_LOOKS:
                self._found = found


GLOVES_LIMIT = 256
VALID_WITHIN_NS = 1_000_000_000
"""A glove keeps its place for so long after a valid frame, against any number of new names."""
LOG_EVERY_S = 10.0
_MOST_LEFT_OUT = 4096
_PARTS_SHOWN = 80

_log = logging.getLogger("glovecal.realtime")


class GlovePipelines:
    """The lanes by key. Belongs to the predicting thread; ``all`` and ``document`` may be asked by others.

    A glove with a place has sent a valid frame, or nobody else wanted the place so far. So junk on any number
    of names keeps nobody out, and never displaces a glove that sends frames.
    Gloves that another process has are in ``left_out``.
    """

    def __init__(self, owners: GloveOwners | None = None, limit: int = GLOVES_LIMIT) -> None:
        """``owners``: None where this process has them all."""
        self.left_out: set[str] = set()
        self._owners, self._known_version = owners, -1
        self._limit = limit
        self._by_key: dict[str, GlovePipeline] = {}
        self._full_until_ns = 0
        """Until then all places belong to gloves that sent a valid frame within a second."""
        self._unusable_names = 0
        self._no_room = 0
        self._given_up = 0
        self._given_up_messages = 0
        self._sentence = ""
        self._logged_at: dict[str, float] = {}

    def all(self) -> list[GlovePipeline]:
        return list(self._by_key.values())

    def of(self, key: str, message: bytes, received_ns: int) -> GlovePipeline | None:
        """The lane for a message, a new one for a new glove; None if it is refused, which is counted."""
        lane = self._by_key.get(key)
        return lane if lane is not None else self._admit(key, message, received_ns)

    def follow_owners(self) -> None:
        """Let go what another process took over, and look again at what others have."""
        owners = self._owners
        if owners is None or owners.version == self._known_version:
            return
        self._known_version = owners.version
        self.left_out.clear()
        kept = owners.kept(each.glove for each in self._by_key.values())
        for key in [key for key, each in self._by_key.items() if each.glove not in kept]:
            del self._by_key[key]

    def document(self) -> dict[str, Any]:
        """For the status document: what was refused before it had a glove, and gloves that made room."""
        return {
            "limit": self._limit,
            "served": len(self._by_key),
            "refused_messages": {"unusable_name": self._unusable_names, "no_room": self._no_room},
            "given_up": {"gloves": self._given_up, "messages": self._given_up_messages},
            "sentence": self._sentence,
        }

    def _admit(self, key: str, message: bytes, received_ns: int) -> GlovePipeline | None:
        try:
            keys, _ = parse_glove_key(key)
        except BadName as error:
            self._unusable_names += 1
            self._say("name", f"frames are refused: {str(error)[:_PARTS_SHOWN]}")
            return None
        if self._owners is not None and not self._owners.may_take(keys.glove):
            if len(self.left_out) >= _MOST_LEFT_OUT:
                self.left_out.clear()
            self.left_out.add(key)
            return None
        if len(self._by_key) >= self._limit and not self._make_room(keys.glove, message, received_ns):
            self._no_room += 1
            return None
        lane = self._by_key[key] = GlovePipeline(keys)
        lane.first_received_ns = received_ns
        lane.valid_ns = received_ns if _is_frame(message) else 0
        if self._owners is not None:
            lane.term, lane.is_taken_over = self._owners.take(keys.glove)
        return lane

    def _make_room(self, glove: str, message: bytes, received_ns: int) -> bool:
        if received_ns < self._full_until_ns:
            return False
        if not _is_frame(message):
            self._say(
                "junk", f"glove {glove} is refused: {self._limit} gloves have a place, it sent no frame"
            )
            return False
        key, lane = min(self._by_key.items(), key=lambda item: item[1].valid_ns)
        if received_ns - lane.valid_ns < VALID_WITHIN_NS:
            self._full_until_ns = lane.valid_ns + VALID_WITHIN_NS
            self._say(
                "room", f"glove {glove} is refused: {self._limit} gloves send valid frames, no more can"
            )
            return False
        del self._by_key[key]
        if self._owners is not None:
            self._owners.leave(lane.glove)
        self._given_up += 1
        self._given_up_messages += lane.received
        why = "its last valid frame is more than 1 s old" if lane.valid_ns else "it sent no valid frame"
        self._say("given up", f"glove {lane.glove} made room for glove {glove}: {why}")
        return True

    def _say(self, what: str, sentence: str) -> None:
        """Log the first of a kind and then one in 10 s at most."""
        now = time.monotonic()
        if now - self._logged_at.get(what, -LOG_EVERY_S) < LOG_EVERY_S:
            return
        self._logged_at[what] = now
        self._sentence = sentence
        _log.warning(
            "%s (messages refused so far: %d for their name, %d for want of room; gloves that made room: %d)",
            sentence, self._unusable_names, self._no_room, self._given_up,
        )  # fmt: skip


def _is_frame(message: bytes) -> bool:
    try:
        decode_frame(message)
    except WireError:
        return False
    return True
